import { expect, test } from 'vitest';
import { Loudness } from '../../src/audio/loudness.ts';

test('whoever is muted is not heard, and as loud as before when they are heard again', () => {
  const gains: number[] = [];
  const loudness = new Loudness((gain) => gains.push(gain));
  loudness.volume = 0.25;
  loudness.muted = true;
  loudness.volume = 0.5; // of a page around; the visitor still wants silence
  expect([gains, loudness.muted]).toEqual([[0.25, 0, 0], true]);
  loudness.muted = false;
  expect(gains.at(-1)).toBe(0.5);
});

test('a volume is from 0 to 1', () => {
  const gains: number[] = [];
  const loudness = new Loudness((gain) => gains.push(gain));
  for (const volume of [7, -1]) loudness.volume = volume;
  expect(gains).toEqual([1, 0]);
});
