/** Whose the head or the body is, where they come from different people. */
export interface Part {
  name: 'head' | 'body';
  kind: string; // of the recordings
  likeness: string;
  build?: string; // of a body that was changed, else as recorded
  outfit?: string; // likewise
}

/** Whose likeness the avatar is, who agreed, who made it of what; older bundles lack the optional entries. */
export interface Provenance {
  kind: string; // of the recordings
  sources: string[];
  consent: string;
  licence: string;
  likeness?: string;
  made_by?: string;
  made_on?: string; // a day such as 2026-11-24
  parts?: Part[];
  voice?: { recording: string; consent: string }; // cloned for the avatar
}

/** Who the avatar is, as far as the page reads it. */
export interface Persona {
  name: string;
  greeting: string;
  languages?: readonly string[];
  suggestions?: readonly string[];
}

/** The texts of a manifest. */
interface Told {
  name: string;
  persona: Persona;
  provenance: Provenance;
}

// UTF-16 units, twice as many as the letters that servers allow: a letter beyond the first plane has two
const NAME = 400;
const GREETING = 8000;
const ORIGIN = { text: 4000, all: 20_000 };
const MOST = { languages: 100, suggestions: 12, sources: 1000, parts: 16 };
const LANGUAGE = /^[A-Za-z]{2,8}(-[A-Za-z0-9]{1,8})*$/;

/** The first text of a manifest that is none, or longer than a page can lay out; null if all are good. */
export function badText({ name, persona, provenance }: Told): string | null {
  const { sources, parts, voice } = provenance ?? {};
  const lists: Record<string, boolean> = {
    name: isText(name, NAME),
    'persona.name': isText(persona?.name, NAME),
    'persona.greeting': isText(persona?.greeting, GREETING),
    'persona.languages': areTexts(persona?.languages ?? [], MOST.languages, NAME, LANGUAGE),
    'persona.suggestions': areTexts(persona?.suggestions ?? [], MOST.suggestions, NAME),
    'provenance.sources': areTexts(sources, MOST.sources, ORIGIN.text),
    'provenance.parts': parts === undefined || (Array.isArray(parts) && parts.length <= MOST.parts),
    provenance: lengthOf(provenance) <= ORIGIN.all,
  };
  const wrong = Object.keys(lists).find((key) => !lists[key]);
  if (wrong) return wrong;
  return (
    badIn('provenance', provenance, ['kind', 'consent', 'licence'], ['likeness', 'made_by', 'made_on']) ??
    (voice ? badIn('provenance.voice', voice, ['recording', 'consent']) : null) ??
    (parts ?? []).map((part) => badIn('provenance.parts', part, ['name', 'kind', 'likeness'], ['build', 'outfit'])).find((key) => key) ??
    null
  );
}

/** The first entry of an object that is no text, of those that it needs and those that it may have. */
function badIn(where: string, value: object | null, needed: string[], others: string[] = []): string | null {
  const texts = (value ?? {}) as Record<string, unknown>;
  const wrong = [...needed, ...others].find((key) => !isText(texts[key], ORIGIN.text) && !(others.includes(key) && texts[key] === undefined));
  return wrong ? `${where}.${wrong}` : null;
}

/** How long all texts in what JSON can hold are together. */
function lengthOf(value: unknown): number {
  if (typeof value === 'string') return value.length;
  return value && typeof value === 'object' ? Object.values(value).reduce<number>((all, one) => all + lengthOf(one), 0) : 0;
}

function isText(value: unknown, most: number): boolean {
  return typeof value === 'string' && value.length <= most;
}

function areTexts(values: unknown, most: number, longest: number, form = /(?:)/): boolean {
  return Array.isArray(values) && values.length <= most && values.every((value) => isText(value, longest) && form.test(value as string));
}
