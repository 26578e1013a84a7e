import type { Manifest } from './manifest.ts';

// UTF-16 units, twice as many as the letters that servers allow: a letter beyond the first plane has two
const NAME = 400;
const TEXT = 8000;
const MOST = { languages: 100, suggestions: 12, sources: 1000, parts: 16 };
const LANGUAGE = /^[A-Za-z]{2,8}(-[A-Za-z0-9]{1,8})*$/;

/** The first text of a manifest that is none, or longer than a page can lay out; null if all are good. */
export function badText({ name, persona, provenance }: Manifest): string | null {
  const { sources, parts = [], voice } = provenance;
  const good: Record<string, boolean> = {
    name: isText(name, NAME),
    'persona.name': isText(persona?.name, NAME),
    'persona.greeting': isText(persona?.greeting, TEXT),
    'persona.languages': areTexts(persona?.languages ?? [], MOST.languages, NAME, LANGUAGE),
    'persona.suggestions': areTexts(persona?.suggestions ?? [], MOST.suggestions, NAME),
    'provenance.sources': areTexts(sources, MOST.sources, TEXT),
    'provenance.parts': Array.isArray(parts) && parts.length <= MOST.parts && parts.every((part) => areGood(part, ['name', 'kind', 'likeness'], ['build', 'outfit'])),
  };
  if (!areGood(provenance, ['kind', 'consent', 'licence'], ['likeness', 'made_by', 'made_on'])) return 'provenance';
  if (voice && !areGood(voice, ['recording', 'consent'])) return 'provenance.voice';
  return Object.keys(good).find((key) => !good[key]) ?? null;
}

function isText(value: unknown, most: number): boolean {
  return typeof value === 'string' && value.length <= most;
}

function areTexts(values: unknown, most: number, longest: number, form = /(?:)/): boolean {
  return Array.isArray(values) && values.length <= most && values.every((value) => isText(value, longest) && form.test(value as string));
}

/** Whether an object has some texts, and perhaps others. */
function areGood(value: object | null, needed: string[], others: string[] = []): boolean {
  const texts = value as Record<string, unknown> | null;
  return !!texts && needed.every((key) => isText(texts[key], TEXT)) && others.every((key) => texts[key] === undefined || isText(texts[key], TEXT));
}

/** A text in which no letter has more marks than writing knows: laying them out takes the square of their number. */
export function calm(text: string): string {
  return text.replace(MARKS, '$1');
}

const MARKS = /([\p{M}\u0e33\u0eb3]{16})[\p{M}\u0e33\u0eb3]+/gu;
