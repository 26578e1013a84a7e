import { expect, test } from 'vitest';
import { inWords } from '../../src/ui/queue.ts';

test.each([
  [3, 125, 'You are third; about two minutes.'],
  [1, null, 'You are next.'],
  [1, 20, 'You are next; less than a minute.'],
  [2, 75, 'You are second; about a minute.'],
  [10, 600, 'You are tenth; about ten minutes.'],
  [11, 700, 'You are number 11; about 12 minutes.'],
  [14, 2200, 'You are number 14; about 35 minutes.'],
  [50, 9000, 'You are number 50; more than an hour.'],
])('place %d after %s s', (position, seconds, words) => {
  expect(inWords({ position, seconds })).toBe(words);
});
