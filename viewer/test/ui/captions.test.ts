import { expect, test } from 'vitest';
import { timeToRead } from '../../src/ui/captions/captions.ts';

test('what was said stays for eight seconds at least, long answers longer', () => {
  expect(timeToRead('')).toBe(8000);
  expect(timeToRead('Hello.')).toBe(8000);
  const long = timeToRead('Words that fill a line, and then another one, and more of them. '.repeat(8));
  expect(long).toBeGreaterThan(12_000);
  expect(long).toBeLessThan(30_000);
});
