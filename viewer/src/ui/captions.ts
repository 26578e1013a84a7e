import { byId } from './elements.ts';

/** What the visitor asked and what the avatar answers, as text. */
export class Captions {
  private readonly asked = byId('question');
  private readonly answered = byId('answer');
  private utterance = -1;

  question(text: string, final: boolean): void {
    this.asked.textContent = text;
    this.asked.classList.toggle('partial', !final);
    if (final) this.answered.textContent = '';
  }

  /** Adds a sentence; a new utterance starts afresh. */
  answer(utterance: number, sentence: string): void {
    const before = utterance === this.utterance ? `${this.answered.textContent} ` : '';
    this.utterance = utterance;
    this.answered.textContent = (before + sentence).trimStart();
    this.answered.scrollTop = this.answered.scrollHeight;
  }
}
