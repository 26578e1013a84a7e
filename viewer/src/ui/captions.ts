import { byId } from './elements.ts';

/** What the visitor asked and the sentence that the avatar says, as text. */
export class Captions {
  private readonly root: HTMLElement;
  private readonly asked: HTMLElement;
  private readonly answered: HTMLElement;

  constructor(root: ParentNode) {
    this.root = byId(root, 'captions');
    this.asked = byId(root, 'question');
    this.answered = byId(root, 'answer');
  }

  question(text: string, final: boolean): void {
    this.root.hidden = false;
    this.asked.textContent = text;
    this.asked.classList.toggle('partial', !final);
    if (final) this.answered.textContent = '';
  }

  answer(sentence: string): void {
    this.root.hidden = false;
    this.answered.textContent = sentence;
  }
}
