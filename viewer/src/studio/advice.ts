import type { PageWords } from '../words/page-words.ts';
import { isKey, say, type Sentence } from '../words/text.ts';

const SHOWN = 4; // spans of one advice that are told; of more only their number

/** One thing that would make a video better, as the server tells it. */
export interface Advice {
  code: string;
  values: Record<string, string | number>;
  spans: [first: number, last: number][]; // s
  detail?: string; // in English, for whoever looks after the machine
}

/** Advice in the words of the page; a sentence that was kept by an earlier version stays as it is. */
export function adviceOf(advice: Advice | string): Sentence {
  if (typeof advice === 'string') return advice;
  const { code, values, spans } = advice;
  const key = `studio.advice.${code}`;
  if (!isKey(key)) return code;
  const what = say(key, values);
  if (spans.length === 0) return what;
  const when = spans.slice(0, SHOWN).map(([first, last]) => spanOf(Math.round(first), Math.round(last)));
  const more = spans.length - when.length;
  return more > 0 ? say('studio.advice.more', { when, n: more, what }) : say('studio.advice.at', { when, what });
}

/** Several sentences as one, one behind the other. */
export function together(sentences: readonly Sentence[]): Sentence {
  return sentences.reduce((first, second) => say('studio.both', { first, second }));
}

/** Shows a list of advice. */
export function showAdvice(list: HTMLElement, words: PageWords, advice: readonly (Advice | string)[]): void {
  const rows = advice.map((one) => {
    const row = document.createElement('li');
    const said = row.appendChild(document.createElement('span'));
    words.write(said, adviceOf(one));
    if (typeof one !== 'string' && one.detail) row.append(detailOf(words, one.detail));
    return row;
  });
  list.replaceChildren(...rows);
}

/** What is told besides, in English, behind a line that opens it. */
function detailOf(words: PageWords, text: string): HTMLDetailsElement {
  const details = document.createElement('details');
  const summary = details.appendChild(document.createElement('summary'));
  words.write(summary, say('studio.making.detail'));
  const shown = details.appendChild(document.createElement('p'));
  shown.lang = 'en';
  shown.textContent = text;
  return details;
}

function spanOf(first: number, last: number): string {
  return first === last ? String(first) : `${first}–${last}`;
}
