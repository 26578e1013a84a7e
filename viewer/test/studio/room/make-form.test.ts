import { expect, test } from 'vitest';
import { qualityOf } from '../../../src/studio/room/make-form.ts';
import studio from '../../../src/words/studio.json';
import { addTexts, textOf } from '../../../src/words/text.ts';

addTexts(studio);

test('a quality says how long it takes, where that is known', () => {
  expect(textOf(qualityOf('quick'), 'en')).toBe('quick, for a first impression');
  expect(textOf(qualityOf('quick', 560), 'en')).toBe('quick, for a first impression (about 9 min)');
  expect(textOf(qualityOf('good', 3), 'de')).toBe('gut (etwa 1 min)');
  expect(textOf(qualityOf('best', 5400), 'ja')).toBe('最高（時間が最もかかる）、約90分');
});
