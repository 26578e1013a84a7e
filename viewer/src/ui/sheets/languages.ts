import type { PageWords } from '../../words/page-words.ts';
import { LANGUAGES, type Language } from '../../words/text.ts';

/** Lets the visitor choose the language of the page. */
export function offerLanguages(select: HTMLSelectElement, words: PageWords, signal: AbortSignal): void {
  const options = Object.entries(LANGUAGES).map(([language, name]) => {
    const option = new Option(name, language);
    option.lang = language;
    return option;
  });
  select.replaceChildren(...options);
  const show = () => (select.value = words.language);
  select.onchange = () => words.choose(select.value as Language);
  words.onChange(show, signal);
  show();
}
