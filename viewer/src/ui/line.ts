import { atEnd } from '../lifetime.ts';
import type { Line } from '../talk/conversation.ts';
import type { PageWords } from '../words/page-words.ts';
import { say } from '../words/text.ts';
import { byId } from './elements.ts';

const PATIENCE = 1000; // ms: nobody notices a shorter drop
const LINGER = 2000; // ms for which a line that was slow is watched: it may be slow again at once

/** Says that what is said does not get to the server, for as long as that is so. */
export class LineNotice {
  private readonly element: HTMLElement;
  private readonly words: PageWords;
  private state: Line = 'up'; // that is shown, or about to be
  private coming: ReturnType<typeof setTimeout> | undefined;

  constructor(root: ParentNode, words: PageWords, signal: AbortSignal) {
    this.element = byId(root, 'line');
    this.words = words;
    atEnd(signal, () => clearTimeout(this.coming));
  }

  show(state: Line): void {
    if (state === this.state) return;
    const wait = { lost: PATIENCE, slow: 0, up: this.state === 'slow' ? LINGER : 0 }[state];
    this.state = state;
    clearTimeout(this.coming);
    this.coming = setTimeout(() => this.write(state), wait);
  }

  private write(state: Line): void {
    this.element.hidden = state === 'up';
    this.words.write(this.element, state === 'up' ? '' : say(`line.${state}`));
  }
}
