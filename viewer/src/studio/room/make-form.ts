import { byId } from '../../ui/elements.ts';
import { say, type Key, type Sentence } from '../../words/text.ts';
import type { BodyPorts } from '../bodies.ts';
import type { Status } from '../recordings.ts';
import { isEnough, isReady } from './readiness.ts';

/** What the form needs of the page around it. */
export interface MakePorts extends Pick<BodyPorts, 'words' | 'recordings' | 'problem' | 'failed'> {
  /** Asks a question that is answered by yes or no. */
  confirm(question: Sentence): boolean;
}

/** Where somebody chooses how much work their avatar is to be, and has it made. */
export class MakeForm {
  private readonly root: ParentNode;
  private readonly ports: MakePorts;
  private readonly begun: (status: Status) => void;
  private readonly select: HTMLSelectElement;
  private status: Status | null = null;
  private busy = false;

  /** @param begun is told of a making that has begun */
  constructor(root: ParentNode, ports: MakePorts, begun: (status: Status) => void) {
    this.root = root;
    this.ports = ports;
    this.begun = begun;
    this.select = byId(root, 'quality');
    this.select.onchange = () => this.write();
    byId<HTMLFormElement>(root, 'make').onsubmit = (event) => {
      event.preventDefault();
      this.make();
    };
  }

  /** What may be chosen of. */
  equip(qualities: readonly string[]): void {
    const options = qualities.map((quality) => {
      const option = new Option(quality, quality, quality === 'good', quality === 'good');
      this.ports.words.write(option, qualityOf(quality));
      return option;
    });
    this.select.replaceChildren(...options);
  }

  /** Chooses the quality of which somebody's avatar was made. */
  choose(quality: string): void {
    this.select.value = quality;
  }

  /**
   * Shows whether somebody's avatar can be made, how long that takes, and what the button does.
   *
   * @param busy a part is being recorded or kept: nothing is made now
   */
  show(status: Status, busy: boolean): void {
    this.status = status;
    this.busy = busy;
    this.write();
  }

  /** Has the avatar made; where a making was stopped or failed, from nothing. */
  make(): void {
    const { ports } = this;
    const { name } = this.status!;
    const anew = isOver(this.status!);
    if (anew && !ports.confirm(say('studio.making.anew.sure'))) return;
    ports.problem(null);
    ports.recordings.make(name, this.select.value, anew).then(this.begun, ports.failed);
  }

  private write(): void {
    const { status, root, select } = this;
    const { words } = this.ports;
    if (!status) return;
    const { making } = status;
    for (const option of select.options) words.write(option, qualityOf(option.value, status.durations[option.value]));
    const ready = isReady(status);
    const isSame = making?.state === 'made' && making.changed.length === 0 && making.quality === select.value;
    const go = byId<HTMLButtonElement>(root, 'go');
    go.disabled = !ready || isSame || this.busy;
    words.write(go, say(isOver(status) ? 'studio.making.anew' : making || status.avatar ? 'studio.make.again' : 'studio.make'));
    words.write(byId(root, 'first'), isSame ? say('studio.make.same') : ready ? more(status) : say('studio.make.first'));
  }
}

/**
 * What a quality is called.
 *
 * @param seconds that it takes, if anybody knows
 */
export function qualityOf(quality: string, seconds?: number): Sentence {
  const name = say(`studio.quality.${quality}` as Key);
  return seconds === undefined ? name : say('studio.quality.time', { quality: name, n: Math.max(Math.round(seconds / 60), 1) });
}

/** What is said of an avatar that could be made: that more would be better, as long as it would. */
function more(status: Status): Sentence {
  return isEnough(status) ? '' : say('studio.make.more');
}

/** Whether a making has ended without an avatar. */
function isOver({ making }: Status): boolean {
  return making?.state === 'stopped' || making?.state === 'failed';
}
