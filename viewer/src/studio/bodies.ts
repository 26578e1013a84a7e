import { byId } from '../ui/elements.ts';
import type { PageWords } from '../words/page-words.ts';
import { say, type Key, type Message, type Sentence } from '../words/text.ts';
import type { Body, Overview, Recordings, Status } from './recordings.ts';

/** What the choice of a body needs of the page around it. */
export interface BodyPorts {
  words: PageWords;
  recordings: Recordings;
  /** Something is wrong, or nothing any more. */
  problem(sentence: Sentence | null): void;
  /** Shows an error. */
  failed(error: unknown): void;
  /** There is something new of the person. */
  changed(status: Status): void;
}

/** Where somebody chooses whether their avatar gets a body, its build and its clothes, in pictures. */
export class Bodies {
  private readonly root: ParentNode;
  private readonly ports: BodyPorts;
  private status: Status | null = null;
  private overview: Overview | null = null;

  constructor(root: ParentNode, ports: BodyPorts) {
    this.root = root;
    this.ports = ports;
    byId(root, 'bodies').onchange = () => void this.choose().catch(ports.failed);
  }

  /** What there is to choose from. */
  equip(overview: Overview): void {
    this.overview = overview;
    const { builds, outfits } = overview;
    this.offer('kinds', 'kind', { alone: say('studio.body.alone'), whole: say('studio.body.whole') });
    this.offer('builds', 'build', worded(builds, buildOf));
    this.offer('outfits', 'outfit', worded(outfits, outfitOf));
    for (const id of ['builds', 'outfits']) byId(this.root, id).classList.toggle('pictured', overview.packaged);
  }

  /** Shows what somebody chose. */
  show(status: Status): void {
    this.status = status;
    const { wanted, build, outfit } = status.body;
    const kind = wanted ? 'whole' : 'alone';
    for (const [name, value] of Object.entries({ kind, build, outfit })) {
      const input = this.root.querySelector<HTMLInputElement>(`#bodies [name=${name}][value=${value}]`);
      if (input) input.checked = true;
    }
    byId(this.root, 'looks').hidden = !wanted;
    this.ports.words.write(byId(this.root, 'body-about'), say(`studio.body.about.${kind}`));
    this.place('build', (value) => [value, outfit]);
    this.place('outfit', (value) => [build, value]);
  }

  private async choose(): Promise<void> {
    const value = (name: string) => this.root.querySelector<HTMLInputElement>(`#bodies [name=${name}]:checked`)!.value;
    const body = { wanted: value('kind') === 'whole', build: value('build'), outfit: value('outfit') };
    this.ports.problem(null);
    try {
      this.ports.changed(await this.ports.recordings.choose(this.status!.name, body));
    } catch (error) {
      this.show(this.status!); // as it is kept
      throw error;
    }
  }

  private offer(id: string, name: string, values: Record<string, Sentence>): void {
    const choices = Object.entries(values).map(([value, sentence]) => {
      const [label, input, text] = (['label', 'input', 'span'] as const).map((tag) => document.createElement(tag));
      Object.assign(input!, { type: 'radio', name, value });
      this.ports.words.write(text!, sentence);
      label!.append(input!, text!);
      return label!;
    });
    byId(this.root, id).replaceChildren(...choices);
  }

  /** Says to the style which picture each choice of a row has, as shares of the sheet of pictures. */
  private place(name: string, pictureOf: (value: string) => [build: string, outfit: string]): void {
    const { builds, outfits } = this.overview!;
    for (const input of this.root.querySelectorAll<HTMLInputElement>(`#bodies [name=${name}]`)) {
      const [build, outfit] = pictureOf(input.value);
      const style = input.parentElement!.style;
      style.setProperty('--across', `${(100 * outfits.indexOf(outfit)) / (outfits.length - 1)}%`);
      style.setProperty('--down', `${(100 * builds.indexOf(build)) / (builds.length - 1)}%`);
    }
  }
}

/** Which part of an avatar is recorded, and which is made. */
export function madeOf({ wanted, build, outfit }: Body): Sentence {
  if (!wanted) return say('studio.body.made.alone');
  return say('studio.body.made.whole', { build: buildOf(build), outfit: outfitOf(outfit) });
}

function buildOf(build: string): Message {
  return say(`studio.build.${build}` as Key);
}

function outfitOf(outfit: string): Message {
  return say(`studio.outfit.${outfit}` as Key);
}

/** Values with the words for each. */
function worded(values: readonly string[], wordsOf: (value: string) => Sentence): Record<string, Sentence> {
  return Object.fromEntries(values.map((value) => [value, wordsOf(value)]));
}
