import { every } from '../lifetime.ts';
import { byId } from '../ui/elements.ts';
import { leadBack } from '../ui/way-back.ts';
import type { PageWords } from '../words/page-words.ts';
import { say, type Key, type Sentence } from '../words/text.ts';
import { showAdvice } from './advice.ts';
import { madeOf } from './bodies.ts';
import { failureOf, type Failure } from './failure.ts';
import type { Making, Recordings, Status } from './recordings.ts';

const STEPS = ['join', 'look', 'track', 'learn', 'measure', 'bake'] as const;
const NONE: Failure = { sentence: '', detail: '' };
const ASKED = 1500; // ms between two questions how far it is
const [VERY_LIKE, LIKE] = [28, 25]; // dB on unseen pictures from which on: heads of docs/benchmarks.md have 27 of a short clip, 28 to 29 of longer films

/** What the view of the making needs of the page around it. */
export interface MakingPorts {
  words: PageWords;
  recordings: Recordings;
  /** Something is wrong, or nothing any more. */
  problem(sentence: Sentence | null): void;
  failed(error: unknown): void;
  changed(status: Status): void;
  /** Begins from nothing, as the form below says. */
  anew(): void;
  /** Asks a question that is answered by yes or no. */
  confirm(question: Sentence): boolean;
}

/** Shows the avatar as it is made: the steps in words, the face in pictures, and the talk at the end. */
export class MakingView {
  private readonly root: ParentNode;
  private readonly ports: MakingPorts;
  private status: Status | null = null;
  private faces = 0;
  private asking = false;
  private lost = false; // the last question had no answer

  constructor(root: ParentNode, ports: MakingPorts, signal: AbortSignal) {
    this.root = root;
    this.ports = ports;
    const { recordings } = ports;
    this.on('halt', async ({ name }) => ports.changed(await recordings.halt(name)));
    this.on('again', async ({ name, making }) => ports.changed(await recordings.make(name, making!.quality)));
    this.on('anew', async () => ports.anew());
    this.on('discard', async ({ name }) => {
      if (ports.confirm(say('studio.making.discard.sure'))) ports.changed(await recordings.discard(name));
    });
    this.on('talk', ({ name }) => this.talk(name));
    every(ASKED, signal, () => void this.ask().catch(ports.failed));
  }

  /** Shows how far somebody's avatar is; nothing for null. */
  show(status: Status | null): void {
    if (status?.name !== this.status?.name) this.faces = 0;
    this.status = status;
    if (status) this.write(status, status.making);
  }

  private on(id: string, act: (status: Status) => Promise<void>): void {
    byId(this.root, id).onclick = () => void (this.status && act(this.status).catch(this.ports.failed));
  }

  private async ask(): Promise<void> {
    const { status } = this;
    if (this.asking || status?.making?.state !== 'running') return;
    this.asking = true;
    try {
      const now = await this.ports.recordings.status(status.name);
      if (this.lost) this.ports.problem(null);
      this.lost = false;
      if (this.status?.name === now.name) this.ports.changed(now);
    } catch (error) {
      this.lost = true;
      throw error;
    } finally {
      this.asking = false;
    }
  }

  private async talk(name: string): Promise<void> {
    const button = byId<HTMLButtonElement>(this.root, 'talk');
    button.disabled = true;
    this.ports.words.write(button, say('studio.talk.opening'));
    try {
      const url = new URL((await this.ports.recordings.talk(name)).url);
      url.hostname = location.hostname; // under which this machine was reached
      leadBack(url, new URL(location.href));
      location.assign(url);
    } finally {
      button.disabled = false;
      this.ports.words.write(button, say('studio.talk'));
    }
  }

  private write(status: Status, making: Making | null): void {
    const { root } = this;
    const { words } = this.ports;
    const state = making?.state ?? 'made'; // of a making that was discarded is left what was finished before
    const isRunning = state === 'running';
    const isOver = state === 'stopped' || state === 'failed';
    words.write(byId(root, 'made'), titleOf(status, making));
    this.showError(making);
    words.write(byId(root, 'made-of'), making && !isOver && !making.changed.includes('on') ? madeOf(status.body) : '');
    words.write(byId(root, 'left'), isRunning ? leftOf(making!.left) : '');
    byId(root, 'steps').replaceChildren(...(making ? STEPS.map((step, number) => this.entry(step, number, making)) : []));
    byId(root, 'steps').hidden = state === 'made';
    this.showFace(status.name, making?.faces ?? 0);
    words.write(byId(root, 'caption'), say(isRunning ? 'studio.making.face' : 'studio.making.face.made'));
    const decibels = making?.decibels ?? null;
    words.write(byId(root, 'decibels'), decibels === null ? '' : likenessOf(decibels));
    byId(root, 'halt').hidden = byId(root, 'closing').hidden = !isRunning;
    byId(root, 'again').hidden = !isOver || !canGoOn(making!);
    byId(root, 'anew').hidden = byId(root, 'discard').hidden = !isOver;
    words.write(byId(root, 'choices'), isOver ? choicesOf(making!) : '');
    byId(root, 'talk').hidden = !status.avatar || isRunning;
    const advice = making?.advice ?? [];
    byId(root, 'better').hidden = advice.length === 0;
    showAdvice(byId(root, 'betters'), words, advice);
  }

  /** Says why it failed in the words of the page, with what is in English alone behind a line that opens it. */
  private showError(making: Making | null): void {
    const { sentence, detail } = making?.state === 'failed' ? failureOf(making, canGoOn(making)) : NONE;
    this.ports.words.write(byId(this.root, 'error'), sentence);
    byId(this.root, 'detail').hidden = detail === '';
    byId(this.root, 'technical').textContent = detail;
  }

  private entry(step: (typeof STEPS)[number], number: number, making: Making): HTMLLIElement {
    const row = document.createElement('li');
    const name = document.createElement('span');
    this.ports.words.write(name, say(`studio.step.${step}`));
    row.append(name);
    const now = STEPS.indexOf(making.step as (typeof STEPS)[number]);
    row.dataset.state = number < now ? 'done' : number === now ? 'now' : 'later';
    if (number === now && making.state === 'running') {
      const bar = document.createElement('progress');
      if (making.share > 0) bar.value = making.share;
      this.ports.words.write(bar, say(`studio.step.${step}` as Key), 'label');
      row.append(bar);
    }
    return row;
  }

  private showFace(name: string, faces: number): void {
    const image = byId<HTMLImageElement>(this.root, 'face');
    image.hidden = faces === 0;
    image.parentElement!.hidden = image.hidden;
    if (faces > 0 && faces !== this.faces) image.src = this.ports.recordings.face(name, faces);
    this.faces = faces;
  }
}

function titleOf({ name }: Status, making: Making | null): Sentence {
  if (making?.state === 'running') return say('studio.making', { name });
  if (making?.state !== 'stopped') return say(`studio.making.${making?.state ?? 'made'}`, { name });
  return say('studio.making.stopped', { step: say(`studio.step.${making.step}` as Key), n: Math.floor(100 * making.share) });
}

/** Whether it can go on where it ended: with other recordings, or such as nothing can be made of, it cannot. */
function canGoOn({ changed, refused }: Making): boolean {
  return !changed.includes('parts') && refused.length === 0;
}

/** What each button does. */
function choicesOf(making: Making): Sentence {
  if (canGoOn(making)) return say('studio.making.choices');
  return say(making.changed.includes('parts') ? 'studio.making.changed' : 'studio.making.over');
}

/**
 * How like the recording an avatar is, in words.
 *
 * @param decibels on pictures that it never saw
 */
export function likenessOf(decibels: number): Sentence {
  const n = Math.round(10 * decibels) / 10;
  return say(n >= VERY_LIKE ? 'studio.making.like.very' : n >= LIKE ? 'studio.making.like' : 'studio.making.like.roughly', { n });
}

/** @param seconds that are left, if anybody knows */
function leftOf(seconds: number | null): Sentence {
  if (seconds === null) return say('studio.left.unknown');
  return seconds < 60 ? say('studio.left.soon') : say('studio.left.minutes', { n: Math.round(seconds / 60) });
}
