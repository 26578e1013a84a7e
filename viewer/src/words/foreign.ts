import type { Language, Tongue } from './text.ts';

/**
 * The languages in which somebody speaks, where that of the page is none of them; empty where it is, or
 * where nobody knows.
 *
 * @param spoken BCP 47; none for any language
 */
export function foreignTo(language: Language, spoken: readonly string[] = []): Tongue[] {
  const bases = spoken.map((tag) => tag.toLowerCase().split('-')[0]);
  return bases.includes(language) ? [] : spoken.map((tongue) => ({ tongue }));
}
