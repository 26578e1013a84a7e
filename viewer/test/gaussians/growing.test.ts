import { expect, test } from 'vitest';
import { GrowingGenerator, widening } from '../../src/gaussians/growing.ts';

class Growing extends GrowingGenerator {}

test('the fewer Gaussians come first, the wider they are', () => {
  expect(widening(1)).toBe(1);
  expect(widening(0.45)).toBe(1);
  expect(widening(0.15)).toBeCloseTo(3 ** 0.3, 12);
  expect(widening(0.08)).toBeGreaterThan(widening(0.15));
});

test('they are as wide as they were learnt once the others are there', () => {
  const some = new Growing(1000, 150);
  expect(some.wide).toBe(widening(0.15));
  some.grow(0.5);
  expect(some.wide).toBeCloseTo((1 + widening(0.15)) / 2, 12);
  some.grow(1);
  expect(some.wide).toBe(1);
  expect(new Growing(1000, 1000).wide).toBe(1);
});
