import { atEnd } from '../../lifetime.ts';

const FADE = 600; // ms, as `main.css` has it
const LOOK = 1000; // ms from one look to the next whether the pointer has gone

/** Lets an element go gently after a while, but not from under the pointer. */
export class Leaving {
  private readonly element: HTMLElement;
  private pointer: MouseEvent | null = null; // where it was last; fingers hide what they point at
  private timer: ReturnType<typeof setTimeout> | undefined;

  constructor(element: HTMLElement, signal: AbortSignal) {
    this.element = element;
    const page = element.ownerDocument.documentElement;
    page.addEventListener('mousemove', (event) => (this.pointer = event), { signal });
    page.addEventListener('mouseleave', () => (this.pointer = null), { signal });
    atEnd(signal, () => clearTimeout(this.timer));
  }

  /** It stays, also if it was about to go. */
  stay(): void {
    clearTimeout(this.timer);
    this.element.classList.remove('gone');
  }

  /** @param wait ms after which it goes */
  after(wait: number): void {
    this.stay();
    this.timer = setTimeout(() => this.go(), wait);
  }

  private go(): void {
    if (this.isPointedAt()) return this.after(LOOK);
    this.element.classList.add('gone');
    this.timer = setTimeout(() => (this.element.hidden = true), FADE);
  }

  private isPointedAt(): boolean {
    if (!this.pointer) return false;
    const { left, right, top, bottom } = this.element.getBoundingClientRect();
    const { clientX: x, clientY: y } = this.pointer;
    return left <= x && x <= right && top <= y && y <= bottom;
  }
}
