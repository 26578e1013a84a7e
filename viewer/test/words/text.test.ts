import { readdirSync, readFileSync } from 'node:fs';
import { join } from 'node:path';
import { describe, expect, test } from 'vitest';
import { foreignTo } from '../../src/words/foreign.ts';
import { codeOf, english, isKey, languageOf, LANGUAGES, say, textOf, type Key, type Language } from '../../src/words/text.ts';
import studio from '../../src/words/studio.json';
import { serviceName } from '../../src/words/services.ts';
import texts from '../../src/words/texts.json';

const VIEWER = join(import.meta.dirname, '../..');
const ALL = Object.entries({ ...texts, ...studio }) as [Key, Record<Language, string | Record<string, string>>][];
const languages = Object.keys(LANGUAGES) as Language[];

const formsOf = (text: string | Record<string, string>) => (typeof text === 'string' ? [text] : Object.values(text));
const namesIn = (text: string) => [...text.matchAll(/\{(\w+)\}/g)].map(([, name]) => name).toSorted();

/** All of the page's own code and HTML. */
function sources(folder = join(VIEWER, 'src')): string[] {
  return readdirSync(folder, { withFileTypes: true }).flatMap((entry) => {
    const path = join(folder, entry.name);
    return entry.isDirectory() ? sources(path) : path.endsWith('.ts') ? [readFileSync(path, 'utf8')] : [];
  });
}

describe('the texts', () => {
  test.each(ALL)('%s says the same with the same values in each language', (_, text) => {
    const names = namesIn(formsOf(text.en)[0]!);
    for (const language of languages) {
      for (const form of formsOf(text[language])) {
        expect(form.trim()).not.toBe('');
        expect(namesIn(form), `${language}: ${form}`).toEqual(names);
      }
    }
  });

  test.each(languages)('in %s has a form for each number', (language) => {
    const { pluralCategories } = new Intl.PluralRules(language).resolvedOptions();
    for (const [key, text] of ALL.filter(([, { en }]) => typeof en !== 'string')) {
      const forms = Object.keys(text[language]);
      expect(forms, key).toEqual(expect.arrayContaining(pluralCategories.filter((name) => name !== 'many'))); // of a million, as others
    }
  });

  test('are all used, and all that HTML names is there', () => {
    const html = ['index.html', 'check.html', 'studio.html'].map((name) => readFileSync(join(VIEWER, name), 'utf8'));
    const named = html.flatMap((text) => [...text.matchAll(/data-(?:text|label|title|placeholder)="([^"]+)"/g)].map(([, key]) => key!));
    expect(named.length).toBeGreaterThan(40);
    expect(named.filter((key) => !isKey(key) && !Object.hasOwn(studio, key))).toEqual([]);
    const code = sources().join('\n');
    const used = new Set([...named, ...[...code.matchAll(/'([a-z][\w.-]+)'/g)].map(([, key]) => key)]);
    const prefixes = [...code.matchAll(/`([a-z.-]+\.)\$\{/g)].map(([, prefix]) => prefix!); // as in `state.${state}`
    const unused = ALL.map(([key]) => key).filter((key) => !used.has(key) && !prefixes.some((prefix) => key.startsWith(prefix)));
    expect(unused).toEqual([]);
  });
});

describe('a sentence', () => {
  test('has its values, its number and its form in each language', () => {
    const place = say('queue.place', { place: 1200 });
    const wait = say('queue.minutes', { place, n: 1 });
    expect(textOf(wait, 'en')).toBe('You are number 1,200. About 1 minute.');
    expect(textOf(wait, 'de')).toBe('Sie sind Nummer 1.200. Etwa 1 Minute.');
    expect(textOf(say('queue.minutes', { place, n: 5 }), 'fr')).toMatch(/^Vous êtes numéro 1.200\. Environ 5 minutes\.$/);
    expect(textOf(say('playback.seconds', { n: 0.5 }), 'fr')).toBe('0,5 seconde');
    expect(textOf(say('playback.seconds', { n: 0.5 }), 'en')).toBe('0.5 seconds');
    expect(textOf(wait, 'ja')).toBe('現在1,200番目です。およそ1分です。');
  });

  test('lists what there are several of', () => {
    const names = [say('stand-ins.recognition'), say('stand-ins.language'), say('stand-ins.voice')];
    expect(textOf(say('stand-ins', { names }), 'en')).toBe('Basic offline services listen, answer, and speak; better ones are in the settings');
    expect(textOf(say('stand-ins-only', { names: names.slice(1) }), 'de')).toBe('Kleine Offline-Dienste antworten und sprechen');
    for (const language of languages) expect(textOf(say('stand-ins', { names }), language).length).toBeLessThan(105); // two lines of a phone
  });

  test('names a language in the language of the sentence', () => {
    expect(textOf(say('ask.in', { language: { tongue: 'en' } }), 'de')).toBe('Auf Englisch fragen');
    expect(textOf(say('ask.in', { language: { tongue: 'de' } }), 'ja')).toBe('ドイツ語で質問');
    expect(textOf(say('ask.in', { language: { tongue: 'sr-RS-Latn' } }), 'de')).toBe('Auf sr-RS-Latn fragen'); // no code
    const languages = [{ tongue: 'en' }, { tongue: 'de' }];
    expect(textOf(say('start.speaks', { name: 'Iris', languages }), 'es')).toBe('Iris entiende y habla inglés y alemán.');
  });

  test('of somebody else stays as it is, and a value that is missing is no secret', () => {
    expect(textOf('Fin de la file.', 'de')).toBe('Fin de la file.');
    expect([codeOf('Fin.'), codeOf(say('replaced'))]).toEqual(['', 'replaced']);
    expect(() => english(say('queue.place'))).toThrow('lacks one of its values');
    expect(english({ key: 'server.voiceless', english: 'Its voice is gone (no sound).' })).toBe('Its voice is gone (no sound).');
    expect(textOf({ key: 'server.voiceless', english: 'Gone.' }, 'es')).toMatch(/^El avatar se ha quedado sin voz/);
  });
});

describe('whoever speaks', () => {
  test('none of the page’s languages speaks others, which are told', () => {
    expect(foreignTo('de', ['en', 'pt-BR'])).toEqual([{ tongue: 'en' }, { tongue: 'pt-BR' }]);
    expect(foreignTo('zh', ['en'])).toEqual([{ tongue: 'en' }]);
  });

  test('the page’s language, in whichever country, or who may speak any, is not foreign', () => {
    expect([foreignTo('en', ['de', 'en-GB']), foreignTo('de', []), foreignTo('fr')]).toEqual([[], [], []]);
  });
});

test.each([
  [['de-AT', 'en'], 'de'],
  [['pt-BR', 'fr-CA', 'en-US'], 'fr'],
  [['zh-Hant-TW'], 'zh'],
  [['constructor', 'JA'], 'ja'],
  [['ko'], 'en'],
  [[], 'en'],
])('whoever reads %j gets %s', (tags, language) => {
  expect(languageOf(tags)).toBe(language);
});

describe('the name of a service', () => {
  const german = (name: string) => textOf(serviceName(name), 'de');

  test('is in the page’s language where it describes', () => {
    expect(german('persona notes')).toBe('Notizen zur Figur');
    expect(german('a server on this machine (llama3 of Ollama)')).toBe('ein Server auf diesem Rechner (llama3 of Ollama)');
    expect(textOf(serviceName('OpenAI-compatible server (gpt)'), 'ja')).toBe('OpenAI互換サーバー（gpt）');
  });

  test('stays where it is one of its own', () => {
    expect(german('espeak-ng')).toBe('espeak-ng');
    expect(german('Whisper (persona notes)')).toBe('Whisper (persona notes)');
  });
});
