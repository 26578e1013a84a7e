import { Notebook } from './notebook.ts';
import type { PageWords } from '../../words/page-words.ts';
import { say } from '../../words/text.ts';
import { byId } from '../elements.ts';
import { icon } from '../icons.ts';

/** What the browser keeps of earlier visits: asks the visitor, shows all of it, and deletes it. */
export class Memory {
  private readonly page: HTMLElement;
  private readonly words: PageWords;
  private readonly notebook: Notebook;
  private readonly kept: HTMLInputElement;
  private offered = false; // the server's avatar remembers visitors

  /** @param home address of the avatar's server */
  constructor(page: HTMLElement, words: PageWords, home: string) {
    this.page = page;
    this.words = words;
    this.notebook = new Notebook(home);
    this.kept = byId(page, 'memory-kept');
    this.kept.onchange = () => this.decide(this.kept.checked);
    byId(page, 'memory-yes').onclick = () => this.decide(true);
    byId(page, 'memory-no').onclick = () => this.decide(false);
    byId(page, 'memory-forget').onclick = () => this.delete();
    this.draw();
  }

  /**
   * A conversation begins, or goes on; a visitor who was not asked yet is asked.
   *
   * @param offered whether the avatar remembers visitors
   * @param tell tells it what was said in earlier visits
   * @returns whether it knows something of them
   */
  offer(offered: boolean, tell: (texts: readonly string[]) => void): boolean {
    this.offered = offered;
    this.draw();
    const { notes } = this.notebook;
    const recalls = offered && notes.length > 0;
    if (recalls) tell(notes);
    return recalls;
  }

  /** The visitor has said something. */
  said(text: string): void {
    if (!this.offered) return;
    this.notebook.said(text);
    this.draw();
  }

  private decide(agreed: boolean): void {
    this.notebook.decide(agreed);
    this.draw();
  }

  private delete(note?: string): void {
    this.notebook.delete(note);
    this.draw();
    this.kept.focus(); // the button is gone
  }

  private draw(): void {
    const { agreed, notes } = this.notebook;
    byId(this.page, 'memory-ask').hidden = !this.offered || agreed !== null;
    byId(this.page, 'memory').hidden = !this.offered && agreed === null;
    this.kept.checked = agreed === true;
    byId(this.page, 'memory-notes').replaceChildren(...notes.map((note) => this.row(note)));
    byId(this.page, 'memory-forget').hidden = notes.length === 0;
  }

  private row(note: string): HTMLLIElement {
    const row = document.createElement('li');
    const text = document.createElement('span');
    text.textContent = note;
    const button = document.createElement('button');
    button.className = 'round quiet';
    button.append(icon('close'));
    button.onclick = () => this.delete(note);
    this.words.name(button, say('memory.delete', { text: note }));
    row.append(text, button);
    return row;
  }
}
