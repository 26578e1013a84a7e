import { expect, test } from 'vitest';
import { Bands, workersFor } from '../../src/soft/bands.ts';

test('fewer workers draw what takes much memory, since each keeps all of it', () => {
  expect([0, 2e7, 2 ** 26].map(workersFor)).toEqual([4, 4, 4]);
  expect([2 ** 26 + 1, 2 ** 27, 2 ** 28, 2 ** 31].map(workersFor)).toEqual([3, 2, 1, 1]);
});

test('bands become narrower where they take longer, and share all columns', () => {
  const bands = new Bands(2);
  expect(bands.of(100)).toEqual([[0, 50], [50, 100]]);
  bands.took([10, 30]);
  expect(bands.of(100)).toEqual([[0, 58], [58, 100]]);
  bands.took([10, 10.5]);
  expect(bands.of(100)).toEqual([[0, 58], [58, 100]]);
});
