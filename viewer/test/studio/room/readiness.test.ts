import { expect, test } from 'vitest';
import type { Part, Status } from '../../../src/studio/recordings.ts';
import { isBrought, isComplete, isEnough, isReady, mayChoose, nextPart } from '../../../src/studio/room/readiness.ts';

const PARTS = ['consent', 'text-1', 'left', 'upload'];

/** Somebody of whom some parts are kept, and so many seconds of 60. */
function recorded(kept: readonly string[], seconds = 0): Status {
  const parts = PARTS.map((id): Part => ({ id, text: '', state: kept.includes(id) ? 'kept' : 'missing' }));
  return { parts, covered: { seconds, enough: 60 } } as unknown as Status;
}

test.each([
  [[], 'consent'],
  [['consent'], 'text-1'],
  [['consent', 'left'], 'text-1'],
  [['consent', 'text-1'], 'left'],
  [['consent', 'text-1', 'left'], 'consent'],
])('of what is kept of %j the next part is %s', (kept, next) => {
  expect(nextPart(recorded(kept))).toBe(next);
});

test('before the consent nothing else may be chosen, and a video only if one was brought', () => {
  const chosen = (kept: string[]) => [...PARTS, 'right', null].filter((part) => mayChoose(recorded(kept), part));
  expect(chosen([])).toEqual(['consent']);
  expect(chosen(['text-1', 'upload'])).toEqual(['consent']);
  expect(chosen(['consent'])).toEqual(['consent', 'text-1', 'left']);
  expect(chosen(['consent', 'upload'])).toEqual(PARTS);
});

test('an avatar can be made of the consent and something else, and well of a video or of enough seconds', () => {
  const told = (kept: string[], seconds = 0) => [isReady, isEnough, isComplete, isBrought].map((is) => is(recorded(kept, seconds)));
  expect(told([])).toEqual([false, false, false, false]);
  expect(told(['consent'], 80)).toEqual([false, false, false, false]);
  expect(told(['text-1', 'left'], 80)).toEqual([false, false, false, false]);
  expect(told(['consent', 'text-1'], 59)).toEqual([true, false, false, false]);
  expect(told(['consent', 'text-1'], 60)).toEqual([true, true, false, false]);
  expect(told(['consent', 'text-1', 'left'], 20)).toEqual([true, false, true, false]);
  expect(told(['consent', 'upload'], 0)).toEqual([true, true, false, true]);
});
