import { describe, expect, test } from 'vitest';
import { Resampler, toPcm16 } from '../../src/audio/resampler.ts';

const TO = 16_000;
const SETTLED = 400; // output samples that the filter's ends touch

const sine = (rate: number, hertz: number, seconds: number) =>
  Float32Array.from({ length: rate * seconds }, (_, i) => Math.sin((2 * Math.PI * hertz * i) / rate));

const rms = (x: Float32Array) => Math.sqrt(x.reduce((sum, v) => sum + v * v, 0) / x.length);

describe.each([44_100, 48_000, 96_000, 16_000, 8000])('from %i Hz', (from) => {
  test('a tone keeps its pitch, strength and phase', () => {
    const out = new Resampler(from, TO).push(sine(from, 1000, 0.5));
    expect(Math.abs(out.length - TO / 2)).toBeLessThan(70);
    const expected = sine(TO, 1000, 0.5);
    for (let i = SETTLED; i < out.length; i++) expect(out[i]).toBeCloseTo(expected[i]!, 3);
  });

  test('blocks of 128 give what one block gives', () => {
    const input = sine(from, 440, 0.2);
    const whole = new Resampler(from, TO).push(input);
    const pieces = new Resampler(from, TO);
    const joined: number[] = [];
    for (let i = 0; i < input.length; i += 128) joined.push(...pieces.push(input.slice(i, i + 128)));
    expect(joined.length).toBe(whole.length);
    joined.forEach((value, i) => expect(value).toBeCloseTo(whole[i]!, 6));
  });
});

test.each([9000, 12_000, 20_000])('a tone of %i Hz does not fold down into speech', (hertz) => {
  const out = new Resampler(48_000, TO).push(sine(48_000, hertz, 0.5));
  expect(rms(out.slice(SETTLED))).toBeLessThan(1e-3); // −57 dB against the tone's 0.707
});

test('over minutes not a sample is lost', () => {
  const resampler = new Resampler(44_100, TO);
  let count = 0;
  for (let second = 0; second < 120; second++) count += resampler.push(new Float32Array(44_100)).length;
  expect(Math.abs(count - 120 * TO)).toBeLessThan(20);
});

test('PCM16 is clipped, not wrapped', () => {
  expect(toPcm16(Float32Array.of(-2, -1, 0, 0.5, 1, 3))).toEqual(Int16Array.of(-32767, -32767, 0, 16384, 32767, 32767));
});
