import type studio from './studio.json';
import texts from './texts.json';

/** The languages of the page, by their own names. */
export const LANGUAGES = { en: 'English', de: 'Deutsch', fr: 'Français', es: 'Español', zh: '中文', ja: '日本語' } as const;

export type Language = keyof typeof LANGUAGES;
export type Key = keyof typeof texts | keyof typeof studio;

/** Words with `{name}` for each value; of several forms, the value `n` decides. */
type Text = string | ({ other: string } & Partial<Record<Intl.LDMLPluralRule, string>>);

type Texts = Readonly<Record<string, Readonly<Record<Language, Text>>>>; // fails where a translation is missing

let TEXTS: Texts = texts;

/** Adds the sentences of a page that most visitors never see (`studio.json`). */
export function addTexts(more: Texts): void {
  TEXTS = { ...TEXTS, ...more };
}

/** A language, which is named in the language of the sentence around it. */
export interface Tongue {
  tongue: string; // BCP 47
}

type One = string | Message | Tongue;

export type Values = Readonly<Record<string, One | number | readonly One[]>>;

/** A sentence of the page, before anybody knows in which language. */
export interface Message {
  key: Key;
  values?: Values;
  /** The English wording, where it says more than that of the page. */
  english?: string;
}

/** What is told to visitors; a text of somebody else stays as it is. */
export type Sentence = Message | string;

/** A sentence of the page, with what stands in it. */
export function say(key: Key, values?: Values): Message {
  return values ? { key, values } : { key };
}

/** Whether the page has words under a name. */
export function isKey(name: string): name is Key {
  return Object.hasOwn(TEXTS, name);
}

/** A sentence in a language. */
export function textOf(sentence: Sentence, language: Language): string {
  if (typeof sentence === 'string') return sentence;
  const { key, values = {}, english } = sentence;
  if (language === 'en' && english) return english;
  const text = TEXTS[key]![language];
  return formOf(text, values, language).replace(/\{(\w+)\}/g, (_, name: string) => valueOf(values[name], language));
}

/** A sentence in English: for logs, and for programs. */
export function english(sentence: Sentence): string {
  return textOf(sentence, 'en');
}

/** The stable name of a sentence; empty for a text of somebody else. */
export function codeOf(sentence: Sentence): string {
  return typeof sentence === 'string' ? '' : sentence.key;
}

/** The first of these languages (BCP 47) that the page has; English if it has none. */
export function languageOf(tags: readonly string[]): Language {
  const bases = tags.map((tag) => tag.toLowerCase().split('-')[0]!);
  return (bases.find((base) => Object.hasOwn(LANGUAGES, base)) as Language | undefined) ?? 'en';
}

function formOf(text: Text, { n }: Values, language: Language): string {
  if (typeof text === 'string') return text;
  return text[new Intl.PluralRules(language).select(Number(n))] ?? text.other;
}

function valueOf(value: Values[string] | undefined, language: Language): string {
  if (value === undefined) throw new Error('a text lacks one of its values');
  if (typeof value === 'number') return new Intl.NumberFormat(language).format(value);
  if (typeof value === 'string' || !('length' in value)) return oneOf(value, language);
  // figures, such as seconds of a video, stand side by side; words are joined by an "and"
  const type = value.some((one) => typeof one === 'string') ? 'unit' : 'conjunction';
  return new Intl.ListFormat(language, { type }).format(value.map((one) => oneOf(one, language)));
}

function oneOf(value: One, language: Language): string {
  if (typeof value === 'string' || !('tongue' in value)) return textOf(value, language);
  try {
    return new Intl.DisplayNames(language, { type: 'language' }).of(value.tongue) ?? value.tongue;
  } catch {
    return value.tongue; // a persona's code that is none of BCP 47
  }
}
