import { english, say, type Message, type Sentence } from '../words/text.ts';

/** How well something works; `none`: it is not there, and need not be. */
export type Verdict = 'good' | 'fair' | 'bad' | 'none';

/** What a check has found. */
export interface Finding {
  verdict: Verdict;
  /** What is so, in one sentence. */
  words: Sentence;
  /** What to do about it, where something is to be done. */
  advice?: Sentence;
}

export const good = (words: Sentence): Finding => ({ verdict: 'good', words });
export const fair = (words: Sentence, advice: Sentence): Finding => ({ verdict: 'fair', words, advice });
export const bad = (words: Sentence, advice: Sentence): Finding => ({ verdict: 'bad', words, advice });
export const none = (words: Sentence): Finding => ({ verdict: 'none', words });

const SUMMARIES = { good: 'check.all', fair: 'check.better', bad: 'check.worse' } as const;

/** One sentence on all findings. */
export function summary(findings: readonly Finding[]): Message {
  const worst = (['bad', 'fair'] as const).find((verdict) => findings.some((finding) => finding.verdict === verdict));
  return say(SUMMARIES[worst ?? 'good']);
}

/**
 * All findings as text, in English for whoever helps; of the device only what browsers tell every page.
 *
 * @param findings by name; null for what was not tried
 */
export function report(findings: ReadonlyMap<Message, Finding | null>, device: readonly string[]): string {
  const lines = [...findings].map(([name, finding]) => `${english(name)}: ${finding ? `${finding.verdict} – ${english(finding.words)}` : 'not tried'}`);
  return [...device, ...lines].join('\n');
}
