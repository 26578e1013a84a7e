import type { Services } from '../protocol.ts';
import type { PageWords } from '../words/page-words.ts';
import { say } from '../words/text.ts';
import { byId } from './elements.ts';

/**
 * Says plainly which services are the small offline ones: under the text box until a first question was answered, and in
 * the settings for ever.
 */
export class StandIns {
  private readonly note: HTMLElement;
  private readonly kept: HTMLElement;
  private readonly words: PageWords;
  private asked = false;
  private known = false; // to the visitor

  constructor(root: ParentNode, words: PageWords) {
    this.note = byId(root, 'stand-ins');
    this.kept = byId(root, 'stand-ins-kept');
    this.words = words;
  }

  /** @param choice whether the settings offer others */
  show(services: Services, choice: boolean): void {
    const simple = (['recognition', 'language', 'voice'] as const).filter((kind) => services[kind].stand_in);
    const names = simple.map((kind) => say(`stand-ins.${kind}`));
    this.kept.hidden = names.length === 0;
    this.note.hidden = this.known || names.length === 0;
    this.words.write(this.note, say(choice ? 'stand-ins' : 'stand-ins-only', { names }));
    this.words.write(this.kept, say('stand-ins-only', { names }));
  }

  /** The visitor has asked something. */
  ask(): void {
    this.asked = true;
  }

  /** Something was said to its end. */
  over(): void {
    this.known ||= this.asked;
    if (this.known) this.note.hidden = true;
  }
}
