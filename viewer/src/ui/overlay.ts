import { THUMBNAIL } from '../bundle/load.ts';
import { byId } from './elements.ts';

/** How the visitor wants to talk. */
export type Choice = 'voice' | 'typing';

/** The first screen: picture, progress, the button that lets sound play, or what went wrong. */
export class Overlay {
  private readonly root = byId('overlay');
  private readonly bar = byId<HTMLProgressElement>('progress');
  private readonly thumbnail = byId<HTMLImageElement>('thumbnail');

  greet(name: string): void {
    byId('overlay-name').textContent = name;
    this.thumbnail.src = THUMBNAIL;
    this.thumbnail.onload = () => (this.thumbnail.hidden = false);
  }

  progress(fraction: number): void {
    this.bar.value = fraction;
  }

  /** Resolves when the visitor chooses; browsers play sound only after such a click. */
  choose(): Promise<Choice> {
    this.bar.hidden = true;
    byId('choices').hidden = false;
    const start = byId<HTMLButtonElement>('start');
    start.focus();
    return new Promise((resolve) => {
      start.onclick = () => resolve('voice');
      byId('start-typing').onclick = () => resolve('typing');
    });
  }

  hide(): void {
    this.root.classList.add('gone');
    this.root.inert = true;
  }

  fail(sentence: string): void {
    this.root.classList.remove('gone');
    this.root.inert = false;
    this.bar.hidden = true;
    byId('choices').hidden = true;
    const text = byId('overlay-error');
    text.textContent = sentence;
    text.hidden = false;
  }
}
