import { byId } from '../elements.ts';
import { icon } from '../icons.ts';
import { isFor } from '../keyboard/keys.ts';

const STILL = 6; // pixels that a pointer may move in a click; farther, it turned the picture
const ACTING = 'button, input, select, a, label, summary, form, section'; // what does something itself

/**
 * A sheet of the page that its button opens and closes. There is room for one: opening a sheet
 * closes the others. Its button "✕" closes it, and so do Escape, wherever the focus is, and a click
 * on the picture; what acts, such as the text box, leaves it open. While it is open, `data-sheet`
 * of the page is its id.
 */
export class Disclosure {
  private readonly page: HTMLElement;
  private readonly button: HTMLElement;
  private readonly part: HTMLElement;
  private readonly changed: (open: boolean) => void;
  private pressed: PointerEvent | null = null;
  private before: HTMLElement | null = null; // had the focus when the sheet was opened

  /**
   * @param page what the sheets lie in, and keys and clicks are heard in
   * @param name id of the sheet; its button's is `NAME-button`, unless there is another
   * @param signal ends the hearing
   * @param changed is told whether the sheet is open
   */
  constructor(page: HTMLElement, name: string, signal: AbortSignal, changed: (open: boolean) => void = () => {}, button = `${name}-button`) {
    this.page = page;
    this.button = byId(page, button);
    this.part = byId(page, name);
    this.changed = changed;
    this.button.onclick = () => this.toggle();
    const cross = this.part.querySelector<HTMLElement>('.close')!;
    cross.append(icon('close'));
    cross.onclick = () => this.close();
    page.addEventListener('keydown', (event) => this.key(event), { signal, capture: true });
    page.addEventListener('pointerdown', (event) => (this.pressed = event), { signal, capture: true });
    page.addEventListener('click', (event) => this.click(event), { signal });
  }

  get isOpen(): boolean {
    return !this.part.hidden;
  }

  toggle(): void {
    this.show(!this.isOpen);
  }

  close(): void {
    this.show(false);
    this.back.focus();
  }

  private show(open: boolean): void {
    if (open) this.closeOther();
    if (open) this.before = (this.page.getRootNode() as Document | ShadowRoot).activeElement as HTMLElement | null;
    const held = this.part.matches(':focus-within');
    this.part.hidden = !open;
    if (held) this.back.focus(); // a keyboard goes on there
    this.button.setAttribute('aria-expanded', String(open));
    if (open) this.page.dataset.sheet = this.part.id;
    else delete this.page.dataset.sheet;
    this.changed(open);
  }

  /** Where the focus goes when the sheet closes: a button that lies in another sheet is not seen then. */
  private get back(): HTMLElement {
    return this.button.checkVisibility() ? this.button : (this.before ?? this.button);
  }

  private closeOther(): void {
    const { sheet } = this.page.dataset;
    if (sheet && sheet !== this.part.id) this.page.querySelector<HTMLElement>(`[aria-controls=${sheet}]`)!.click();
  }

  private key(event: KeyboardEvent): void {
    if (!isFor('escape', event) || !this.isOpen) return;
    event.stopPropagation(); // otherwise it silences the avatar
    this.close();
  }

  private click({ target, clientX, clientY }: MouseEvent): void {
    if (!this.isOpen || (target as Element).closest(ACTING)) return;
    const moved = this.pressed ? Math.hypot(clientX - this.pressed.clientX, clientY - this.pressed.clientY) : 0;
    if (moved < STILL) this.close();
  }
}
