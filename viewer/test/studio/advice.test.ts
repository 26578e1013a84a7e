import { expect, test } from 'vitest';
import { adviceOf, together } from '../../src/studio/advice.ts';
import { Refusal } from '../../src/studio/recordings.ts';
import studio from '../../src/words/studio.json';
import { addTexts, textOf } from '../../src/words/text.ts';

addTexts(studio);
const LIPS = { code: 'lips-still', values: {}, spans: [] };

test('advice is said in the language of the page, with its values and its seconds', () => {
  expect(textOf(adviceOf(LIPS), 'de')).toBe('Die Lippen bewegen sich kaum: Lesen Sie etwas laut vor.');
  expect(textOf(adviceOf({ ...LIPS, spans: [[3.1, 3.2], [7, 9.2]] }), 'en')).toBe('At 3, 7–9 s: The lips hardly move: read something aloud.');
  const short = { code: 'short-left', values: { n: 7, goal: 20 }, spans: [] };
  expect(textOf(adviceOf(short), 'es')).toBe('Gire más la cabeza a la izquierda: giró 7° y bastan 20°.');
});

test('of many seconds the first are told, and how many more there are', () => {
  const spans = [1, 2, 3, 4, 5, 6].map((second): [number, number] => [second, second]);
  expect(textOf(adviceOf({ ...LIPS, spans }), 'en')).toMatch(/^At 1, 2, 3, 4 s and 2 more times: /);
  expect(textOf(adviceOf({ ...LIPS, spans: spans.slice(1) }), 'en')).toMatch(/^At 2, 3, 4, 5 s and 1 more time: /);
});

test('a sentence of an earlier version stays, and what the page does not know is shown by its name', () => {
  expect(adviceOf('the face is dark.')).toBe('the face is dark.');
  expect(adviceOf({ code: 'of-tomorrow', values: {}, spans: [] })).toBe('of-tomorrow');
});

test('a refused video says all that is wrong with it', () => {
  const faceless = { code: 'face-none', values: {}, spans: [] };
  expect(textOf(together([adviceOf(LIPS)]), 'en')).toBe('The lips hardly move: read something aloud.');
  const refusal = new Refusal(422, 'unusable', 'x', [faceless, LIPS]);
  expect(textOf(refusal.sentence, 'de')).toMatch(/^Aus diesem Video .* behalten\. Kein Gesicht gefunden: .* ohne Maske\. Die Lippen bewegen sich kaum: /);
});
