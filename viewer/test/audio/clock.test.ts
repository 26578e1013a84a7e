import { expect, test } from 'vitest';
import { heardTime, type AudioClock } from '../../src/audio/clock.ts';

const clock = (stamp: AudioTimestamp | undefined, latency = {}): AudioClock => ({
  currentTime: 10,
  baseLatency: 0.01,
  ...latency,
  ...(stamp && { getOutputTimestamp: () => stamp }),
});

test('the time stamp tells what leaves the loudspeaker', () => {
  // 9.7 s was heard at 5000 ms; 40 ms later it is 9.74 s.
  expect(heardTime(clock({ contextTime: 9.7, performanceTime: 5000 }), 5040)).toBeCloseTo(9.74, 9);
});

test('nothing is heard before it was made', () => {
  expect(heardTime(clock({ contextTime: 9.99, performanceTime: 5000 }), 5020)).toBe(10);
});

test.each([
  ['there is none', undefined],
  ['it is zero', { contextTime: 0, performanceTime: 0 }],
  ['it lags by minutes', { contextTime: 9, performanceTime: 90_000 }],
  ['it is ahead', { contextTime: 11, performanceTime: 5000 }],
])('the latency is asked instead of a time stamp when %s', (_, stamp) => {
  expect(heardTime(clock(stamp), 5000)).toBeCloseTo(9.99, 9);
  expect(heardTime(clock(stamp, { outputLatency: 0.2 }), 5000)).toBeCloseTo(9.8, 9);
});
