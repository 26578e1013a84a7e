import { remember, remembered } from '../remembered.ts';
import { languageOf, say, textOf, type Key, type Language, type Sentence } from './text.ts';

/** Where words stand in an element. In HTML an attribute `data-…` names them, such as `data-label="send"`. */
const PLACES = {
  text: (element: Element, words: string) => void (element.textContent !== words && (element.textContent = words)),
  label: (element: Element, words: string) => element.setAttribute('aria-label', words),
  title: (element: Element, words: string) => element.setAttribute('title', words),
  placeholder: (element: Element, words: string) => element.setAttribute('placeholder', words),
  valuetext: (element: Element, words: string) => element.setAttribute('aria-valuetext', words),
} as const;

type Place = keyof typeof PLACES;

const WORDED = [...Object.keys(PLACES).map((place) => `[data-${place}]`), '[data-worded]'].join();

/** The words of a page, or of what is embedded in one: all of them change with the language. */
export class PageWords {
  private readonly root: ParentNode & Node;
  private readonly written = new WeakMap<Element, Map<Place, Sentence>>();
  private spoken: Language;
  private readonly listeners = new Set<() => void>();

  /**
   * @param root what the words stand in; it, or what lies in a shadow root, gets `lang`
   * @param wished language of the page around, if it tells one; what the visitor chose comes first
   */
  constructor(root: ParentNode & Node, wished?: string | null) {
    this.root = root;
    this.spoken = chosen(wished);
    this.translate();
  }

  get language(): Language {
    return this.spoken;
  }

  /** The visitor chooses a language, which is remembered. */
  choose(language: Language): void {
    remember('language', language);
    this.change(language);
  }

  /** The page around has another language. */
  wish(language: string | null): void {
    this.change(chosen(language));
  }

  /** A sentence in the page's language. */
  text(sentence: Sentence): string {
    return textOf(sentence, this.spoken);
  }

  /** Writes a sentence; it changes with the language. */
  write(element: Element, sentence: Sentence, place: Place = 'text'): void {
    const written = this.written.get(element) ?? new Map<Place, Sentence>();
    this.written.set(element, written.set(place, sentence));
    element.toggleAttribute('data-worded', true);
    PLACES[place](element, this.text(sentence));
  }

  /** Names a button that shows an icon only. */
  name(element: Element, sentence: Sentence, title: Sentence = sentence): void {
    this.write(element, sentence, 'label');
    this.write(element, title, 'title');
  }

  /** Is called whenever the language has changed. */
  onChange(act: () => void, signal: AbortSignal): void {
    this.listeners.add(act);
    signal.addEventListener('abort', () => this.listeners.delete(act), { once: true });
  }

  /** Writes everything anew, also what came into the page meanwhile. */
  translate(): void {
    const outermost = this.root instanceof ShadowRoot ? this.root.children : [this.root as unknown as HTMLElement];
    for (const element of outermost) (element as HTMLElement).lang = this.spoken;
    for (const element of this.root.querySelectorAll<HTMLElement>(WORDED)) this.translateElement(element);
  }

  private translateElement(element: HTMLElement): void {
    const written = this.written.get(element);
    for (const place of Object.keys(PLACES) as Place[]) {
      const key = element.dataset[place] as Key | undefined;
      const sentence = written?.get(place) ?? (key && say(key));
      if (sentence) PLACES[place](element, this.text(sentence));
    }
  }

  private change(language: Language): void {
    if (language === this.spoken) return;
    this.spoken = language;
    this.translate();
    for (const act of this.listeners) act();
  }
}

function chosen(wished?: string | null): Language {
  const own = remembered('language');
  return languageOf([...(own ? [own] : []), ...(wished ? [wished] : []), ...navigator.languages]);
}
