import type { PageWords } from '../../words/page-words.ts';
import { say, type Key, type Sentence } from '../../words/text.ts';
import { byId } from '../elements.ts';
import { isFor, isForTexts, KEYS, type Deed } from '../keyboard/keys.ts';
import { Disclosure } from './disclosure.ts';

type Row = readonly [how: Key, what: Key];

const MOUSE: readonly Row[] = [
  ['help.drag', 'help.turn'],
  ['help.wheel', 'help.zoom'],
  ['help.double-click', 'help.focus'],
];
const TOUCH: readonly Row[] = [
  ['help.finger', 'help.turn'],
  ['help.fingers', 'help.zoom-shift'],
  ['help.double-tap', 'help.focus'],
];

/** What keys do, and what of the page has to be there for it. */
const DEEDS: Readonly<Record<Deed, { what: Key; where: 'page' | 'picture'; needs?: string }>> = {
  talk: { what: 'talk', where: 'page', needs: '#composer' },
  write: { what: 'help.write', where: 'page', needs: '#composer' },
  escape: { what: 'help.escape', where: 'page' },
  mute: { what: 'help.mute', where: 'page', needs: '#composer' },
  transcript: { what: 'transcript', where: 'page', needs: '#drawer-button' },
  view: { what: 'help.views', where: 'page', needs: '.views' },
  help: { what: 'help.help', where: 'page' },
  turn: { what: 'help.turn', where: 'picture' },
  zoom: { what: 'help.zoom', where: 'picture' },
  home: { what: 'help.home', where: 'picture' },
  play: { what: 'help.play', where: 'picture', needs: '#player' },
  frame: { what: 'help.frame', where: 'picture', needs: '#player' },
};

/** What is written on keys that are not named as they are told to pages. */
const CAPS: Readonly<Record<string, Sentence>> = {
  ' ': say('kbd.space'),
  Escape: say('kbd.escape'),
  Home: say('kbd.home'),
  ArrowLeft: '←',
  ArrowRight: '→',
  ArrowUp: '↑',
  ArrowDown: '↓',
  '-': '−',
};

/** The sheet that tells what pointers, fingers and keys do. */
export class Help {
  private readonly page: HTMLElement;
  private readonly words: PageWords;

  constructor(page: HTMLElement, words: PageWords, signal: AbortSignal) {
    this.page = page;
    this.words = words;
    const sheet = new Disclosure(page, 'help', signal, (open) => open && this.opened());
    const button = byId(page, 'help-button');
    words.write(button, say('keyed', { name: say('help'), key: KEYS.help[0] }), 'title');
    const press = (event: KeyboardEvent) => {
      if (!isFor('help', event) || isForTexts(event) || button.closest('[inert]')) return; // where something covers the page nobody would see it
      event.preventDefault();
      sheet.toggle();
    };
    page.addEventListener('keydown', press, { signal });
  }

  private opened(): void {
    this.fill('help-mouse', MOUSE.map(([how, what]) => [this.worded('dt', say(how)), what]));
    this.fill('help-touch', TOUCH.map(([how, what]) => [this.worded('dt', say(how)), what]));
    const deeds = (Object.keys(DEEDS) as Deed[]).filter((deed) => this.has(DEEDS[deed].needs));
    for (const place of ['page', 'picture'] as const) {
      const here = deeds.filter((deed) => DEEDS[deed].where === place);
      this.fill(`help-${place}`, here.map((deed) => [this.keys(deed), DEEDS[deed].what]));
    }
    byId(this.page, 'help').focus({ preventScroll: true });
  }

  private has(part?: string): boolean {
    return !part || this.page.querySelector(`${part}:not([hidden])`) !== null;
  }

  private fill(id: string, rows: readonly (readonly [HTMLElement, Key])[]): void {
    byId(this.page, id).replaceChildren(...rows.flatMap(([term, what]) => [term, this.worded('dd', say(what))]));
  }

  private keys(deed: Deed): HTMLElement {
    const term = document.createElement('dt');
    term.append(...KEYS[deed].map((key) => this.cap(key)));
    return term;
  }

  /** A key as it looks. */
  private cap(key: string): HTMLElement {
    return this.worded('kbd', CAPS[key] ?? key.toUpperCase());
  }

  private worded(tag: 'dt' | 'dd' | 'kbd', sentence: Sentence): HTMLElement {
    const element = document.createElement(tag);
    this.words.write(element, sentence);
    return element;
  }
}
