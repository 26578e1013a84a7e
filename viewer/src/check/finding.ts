/** How well something works; `none`: it is not there, and need not be. */
export type Verdict = 'good' | 'fair' | 'bad' | 'none';

/** What a check has found. */
export interface Finding {
  verdict: Verdict;
  /** What is so, in one sentence. */
  words: string;
  /** What to do about it, where something is to be done. */
  advice?: string;
}

export const good = (words: string): Finding => ({ verdict: 'good', words });
export const fair = (words: string, advice: string): Finding => ({ verdict: 'fair', words, advice });
export const bad = (words: string, advice: string): Finding => ({ verdict: 'bad', words, advice });
export const none = (words: string): Finding => ({ verdict: 'none', words });

const SUMMARIES: Record<Exclude<Verdict, 'none'>, string> = {
  good: 'All that was checked works.',
  fair: 'It works, but something could be better.',
  bad: 'Something does not work: see below what to do.',
};

/** One sentence on all findings. */
export function summary(findings: readonly Finding[]): string {
  const worst = (['bad', 'fair'] as const).find((verdict) => findings.some((finding) => finding.verdict === verdict));
  return SUMMARIES[worst ?? 'good'];
}

/**
 * All findings as text; of the device only what browsers tell every page.
 *
 * @param findings by name; null for what was not tried
 */
export function report(findings: ReadonlyMap<string, Finding | null>, device: readonly string[]): string {
  const lines = [...findings].map(([name, finding]) => `${name}: ${finding ? `${finding.verdict} – ${finding.words}` : 'not tried'}`);
  return [...device, ...lines].join('\n');
}
