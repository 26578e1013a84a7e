import { isKey, say, type Sentence } from '../words/text.ts';
import { adviceOf, together } from './advice.ts';
import { partName, type Making } from './recordings.ts';

/** Why a making failed, in the words of the page; `detail` is in English, for whoever looks after the machine. */
export interface Failure {
  sentence: Sentence;
  detail: string;
}

/**
 * Says why a making failed: what is wrong with the video, or the failure by its code. Of one that nobody foresaw it
 * says so, with the English sentence as detail.
 *
 * @param canGoOn whether it can go on where it ended
 */
export function failureOf({ refused, code = '', values = {}, error }: Making, canGoOn: boolean): Failure {
  if (refused.length > 0) return { sentence: together(refused.map(adviceOf)), detail: '' };
  const key = `studio.failure.${code}`;
  if (isKey(key)) return { sentence: say(key, named(values)), detail: '' };
  const stopped = say('studio.making.unforeseen');
  if (!canGoOn) return { sentence: stopped, detail: error };
  const on = say('studio.making.unforeseen.on', { again: say('studio.making.again') });
  return { sentence: together([stopped, on]), detail: error };
}

/** The values of a failure, with parts of a recording by the names that they have on the page. */
function named(values: Record<string, string | number>): Record<string, string | number | ReturnType<typeof partName>> {
  const shown: ReturnType<typeof named> = { ...values };
  for (const name of ['part', 'first']) {
    if (typeof values[name] === 'string') shown[name] = partName(values[name].replace(/\.\w+$/, ''));
  }
  return shown;
}
