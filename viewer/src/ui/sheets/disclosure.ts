/** A part of the page that its button opens and closes. */
export class Disclosure {
  private readonly button: HTMLElement;
  private readonly part: HTMLElement;
  private readonly changed: (open: boolean) => void;

  /** @param changed is told whether the part is open */
  constructor(button: HTMLElement, part: HTMLElement, changed: (open: boolean) => void = () => {}) {
    this.button = button;
    this.part = part;
    this.changed = changed;
    button.onclick = () => this.toggle();
    part.onkeydown = (event) => {
      if (event.key !== 'Escape') return;
      event.stopPropagation(); // elsewhere it silences the avatar
      this.close();
    };
  }

  get isOpen(): boolean {
    return !this.part.hidden;
  }

  toggle(): void {
    this.show(!this.isOpen);
  }

  /** Closes the part; a keyboard goes on at its button. */
  close(): void {
    this.show(false);
    this.button.focus();
  }

  private show(open: boolean): void {
    if (open) this.closeOthers();
    this.part.hidden = !open;
    this.button.setAttribute('aria-expanded', String(open));
    this.changed(open);
  }

  /** There is room for one of the parts that lie side by side. */
  private closeOthers(): void {
    const header = this.part.closest('header');
    for (const button of header?.querySelectorAll<HTMLElement>('[aria-expanded=true]') ?? []) {
      const beside = header!.querySelector(`#${button.getAttribute('aria-controls')}`);
      if (beside && button !== this.button) button.click();
    }
  }
}
