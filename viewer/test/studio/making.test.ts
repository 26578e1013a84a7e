import { expect, test } from 'vitest';
import { likenessOf } from '../../src/studio/making.ts';
import studio from '../../src/words/studio.json';
import { addTexts, LANGUAGES, textOf, type Language } from '../../src/words/text.ts';

addTexts(studio);

test.each([
  [31.24, 'Very like the recording (31.2 dB on pictures it never saw)'],
  [27.96, 'Very like the recording (28 dB on pictures it never saw)'],
  [27.94, 'Like the recording (27.9 dB on pictures it never saw)'],
  [25, 'Like the recording (25 dB on pictures it never saw)'],
  [24.9, 'Roughly like the recording (24.9 dB on pictures it never saw)'],
])('an avatar of %f dB is said to be: %s', (decibels, words) => {
  expect(textOf(likenessOf(decibels), 'en')).toBe(words);
});

test('the levels differ in each language', () => {
  for (const language of Object.keys(LANGUAGES) as Language[]) {
    const words = [20, 26, 30].map((decibels) => textOf(likenessOf(decibels), language).replace(/\d+/, ''));
    expect(new Set(words).size, language).toBe(3);
  }
});
