import { remember, remembered } from '../../remembered.ts';
import type { PageWords } from '../../words/page-words.ts';
import { Disclosure } from './disclosure.ts';
import { byId } from '../elements.ts';
import { icon } from '../icons.ts';
import { offerLanguages } from './languages.ts';

const SIZES = ['small', 'normal', 'large'];

/** The sheet of what the visitor may choose: language, captions, what a screen reader says, and to end the talk. */
export class Settings {
  private readonly page: HTMLElement;
  private readonly sheet: Disclosure;
  private readonly announced: HTMLInputElement;

  constructor(page: HTMLElement, words: PageWords, signal: AbortSignal) {
    this.page = page;
    byId(page, 'settings-button').append(icon('sliders'));
    this.sheet = new Disclosure(page, 'settings', signal);
    offerLanguages(byId(page, 'language'), words, signal);
    this.announced = this.offer('announced', () => {});
    this.offer('captions-shown', (shown) => (page.dataset.captions = shown ? 'on' : 'off'));
    this.offerSizes(byId(page, 'captions-size'));
  }

  /** Whether a screen reader is told what was said. */
  get announces(): boolean {
    return this.announced.checked;
  }

  /**
   * There is somebody to talk with.
   *
   * @param hangUp ends the talk
   */
  offerTalk(hangUp: () => void): void {
    byId(this.page, 'caption-settings').hidden = false;
    const button = byId<HTMLButtonElement>(this.page, 'hang-up');
    button.hidden = false;
    button.onclick = () => {
      this.sheet.close();
      hangUp();
    };
  }

  /** A switch that is on until the visitor turns it off. */
  private offer(id: string, changed: (on: boolean) => void): HTMLInputElement {
    const input = byId<HTMLInputElement>(this.page, id);
    input.checked = remembered(id) !== 'off';
    input.onchange = () => {
      remember(id, input.checked ? 'on' : 'off');
      changed(input.checked);
    };
    changed(input.checked);
    return input;
  }

  private offerSizes(select: HTMLSelectElement): void {
    const show = () => (this.page.dataset.captionsSize = select.value);
    const chosen = remembered('captions-size');
    select.value = chosen && SIZES.includes(chosen) ? chosen : 'normal';
    select.onchange = () => {
      remember('captions-size', select.value);
      show();
    };
    show();
  }
}
