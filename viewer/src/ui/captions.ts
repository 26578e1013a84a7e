import type { Progress } from '../talk/captioning.ts';
import { byId } from './elements.ts';

/** What the visitor asked and the sentence that the avatar says, word by word as it is heard. */
export class Captions {
  private readonly root: HTMLElement;
  private readonly asked: HTMLElement;
  private readonly answered: HTMLElement;
  private readonly heardWords = document.createElement('span');
  private readonly nextWords = document.createElement('span'); // keep their place, so that no line jumps

  /** @param lang language of the talk; empty if it is unknown */
  constructor(root: ParentNode, lang: string) {
    this.root = byId(root, 'captions');
    this.asked = byId(root, 'question');
    this.answered = byId(root, 'answer');
    this.root.lang = lang;
    this.nextWords.className = 'unheard';
    this.answered.append(this.heardWords, this.nextWords);
  }

  question(text: string, final: boolean): void {
    this.root.hidden = false;
    this.asked.textContent = text;
    this.asked.classList.toggle('partial', !final);
    if (final) this.write('', '');
  }

  heard({ text, heard }: Progress): void {
    this.root.hidden = false;
    this.write(text.slice(0, heard), text.slice(heard));
    const { answered, nextWords } = this;
    const line = parseFloat(getComputedStyle(answered).lineHeight);
    answered.scrollTop = nextWords.offsetTop + line - answered.clientHeight; // the present line is the last one seen
  }

  /** What was not heard is not said any more. */
  over(): void {
    this.write(this.heardWords.textContent!, '');
  }

  private write(heard: string, next: string): void {
    this.heardWords.textContent = heard;
    this.nextWords.textContent = next;
  }
}
