import { expect, test } from 'vitest';
import { Loudness } from '../../src/gesture/performing/listening.ts';

test('a window has a sample on each side at the lowest rates, too', () => {
  expect(new Loudness(20).push(new Int16Array(4).fill(3277)).map(Math.round)).toEqual(Array(18).fill(-20));
});
