import { expect, test } from 'vitest';
import { inWords } from '../../src/ui/queue.ts';
import { english } from '../../src/words/text.ts';

test.each([
  [3, 125, 'You are number 3. About 2 minutes.'],
  [1, null, 'You are next.'],
  [1, 20, 'You are next. Less than a minute.'],
  [2, 75, 'You are number 2. About 1 minute.'],
  [10, 600, 'You are number 10. About 10 minutes.'],
  [11, 700, 'You are number 11. About 12 minutes.'],
  [14, 2200, 'You are number 14. About 35 minutes.'],
  [50, 9000, 'You are number 50. More than an hour.'],
])('place %d after %s s', (position, seconds, words) => {
  expect(english(inWords({ position, seconds }))).toBe(words);
});
