import { expect, test } from 'vitest';
import { failureOf } from '../../src/studio/failure.ts';
import type { Making } from '../../src/studio/recordings.ts';
import studio from '../../src/words/studio.json';
import { addTexts, LANGUAGES, textOf, type Language } from '../../src/words/text.ts';

addTexts(studio);
const FAILED: Making = {
  state: 'failed',
  quality: 'quick',
  step: 'learn',
  share: 0.4,
  left: null,
  advice: [],
  refused: [],
  faces: 0,
  error: 'ZeroDivisionError: division by zero',
  decibels: null,
  changed: [],
};

test('what somebody foresaw is said in the language of the page, with its numbers and without English', () => {
  const { sentence, detail } = failureOf({ ...FAILED, code: 'disk-room', values: { free: 0.1, needed: 1500.5 } }, true);
  expect(textOf(sentence, 'de')).toBe('Auf der Festplatte sind noch 0,1 GB frei, und 1.500,5 GB braucht es: Schaffen Sie Platz.');
  expect(textOf(sentence, 'en')).toBe('The disk has 0.1 GB left and 1,500.5 GB are needed: free some space.');
  expect(detail).toBe('');
});

test('parts have the names of the page', () => {
  const { sentence } = failureOf({ ...FAILED, code: 'shape', values: { part: 'left.webm', first: 'text-1.webm' } }, true);
  expect(textOf(sentence, 'fr')).toMatch(/^Gauche n’a pas le même format que Texte 1 : /);
  expect(textOf(sentence, 'ja')).toMatch(/^左は文章 1と画面の形が違います。/);
});

test('a refused video says what is wrong with it, whatever the error is called', () => {
  const refused = [{ code: 'faces', values: {}, spans: [] }];
  const { sentence, detail } = failureOf({ ...FAILED, refused, code: 'gone' }, false);
  expect(textOf(sentence, 'es')).toMatch(/^Se ven dos caras: /);
  expect(detail).toBe('');
});

test('what nobody foresaw is said in general, with the button that goes on, and its English as a detail', () => {
  const { sentence, detail } = failureOf(FAILED, true);
  expect(textOf(sentence, 'en')).toBe(
    'Something unforeseen stopped the making; what you recorded is kept. Press “Go on from there” to go on.',
  );
  expect(textOf(sentence, 'de')).toBe(
    'Etwas Unvorhergesehenes hat das Erstellen angehalten; was Sie aufgenommen haben, bleibt. Mit „Von dort weitermachen“ geht es weiter.',
  );
  expect(detail).toBe('ZeroDivisionError: division by zero');
  const over = failureOf({ ...FAILED, code: 'of-tomorrow' }, false);
  expect(textOf(over.sentence, 'en')).toBe('Something unforeseen stopped the making; what you recorded is kept.');
  for (const language of Object.keys(LANGUAGES) as Language[]) expect(textOf(sentence, language)).toContain(textOf(over.sentence, language));
});
