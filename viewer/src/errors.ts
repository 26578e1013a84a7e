import { brief } from './words/calm.ts';
import { english, say, type Sentence } from './words/text.ts';

/** An error that says in one sentence what a visitor can read; its message is that sentence in English. */
export class PageError extends Error {
  override name = 'PageError';
  readonly sentence: Sentence;

  constructor(sentence: Sentence) {
    super(brief(english(sentence)));
    this.sentence = typeof sentence === 'string' ? brief(sentence) : sentence;
  }
}

/** The sentence to show for anything thrown. */
export function sentenceOf(error: unknown): Sentence {
  if (error instanceof PageError) return error.sentence;
  return say('error.page', { detail: brief(error instanceof Error ? error.message : String(error)) });
}
