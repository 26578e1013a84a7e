import { describe, expect, test } from 'vitest';
import { ladder, Quality } from '../../src/stage/quality.ts';
import { random } from '../../support/random.ts';

const ALL = ladder({ backdrop: true, gaussians: true });

/** Draws for some seconds of virtual time, each picture as long as the level makes it; the levels that were shown, with when each began. */
function draw(quality: Quality, seconds: number, picture: (index: number, now: number) => number): [number, number][] {
  const log: [number, number][] = [[0, quality.index]];
  for (let now = 0; now < seconds; ) {
    const step = picture(quality.index, now);
    now += step;
    if (quality.picture(step)) log.push([now, quality.index]);
  }
  return log;
}

describe('the levels', () => {
  test('take from the backdrop first, then pixels, then Gaussians; none takes nothing', () => {
    const first = (key: 'backdrop' | 'pixels' | 'gaussians') => ALL.findIndex((level) => level[key] < 1);
    expect(ALL[0]).toEqual({ backdrop: 1, pixels: 1, gaussians: 1 });
    expect([first('backdrop'), first('pixels'), first('gaussians')]).toEqual([1, 3, 5]);
    for (const savings of [{ backdrop: false, gaussians: false }, { backdrop: false, gaussians: true }, { backdrop: true, gaussians: false }]) {
      const levels = ladder(savings);
      levels.slice(1).forEach((level, i) => {
        const cheaper = Object.entries(level).filter(([key, share]) => share < levels[i]![key as keyof typeof level]);
        expect(cheaper).toHaveLength(1);
      });
      expect(levels.every((level) => level.backdrop === 1)).toBe(!savings.backdrop);
      expect(levels.every((level) => level.gaussians === 1)).toBe(!savings.gaussians);
    }
  });
});

describe('quality', () => {
  test.each([60, 120, 144, 30])('stays the best on a screen of %d Hz that is kept up with', (rate) => {
    const next = random(rate);
    const quality = new Quality(ALL);
    expect(draw(quality, 120, () => (0.98 + 0.04 * next()) / rate)).toEqual([[0, 0]]);
  });

  test('holds the rate that a headset needs, and that of the page afterwards', () => {
    const quality = new Quality(ALL);
    const takes = (index: number) => 0.022 * 0.9 ** index; // 45 pictures per second of the best
    expect(draw(quality, 60, takes)).toEqual([[0, 0]]);
    quality.aim(61);
    const levels = draw(quality, 60, takes).map(([, index]) => index);
    expect(Math.max(...levels)).toBe(3); // the first one with 61 per second
    quality.aim();
    expect(draw(quality, 60, takes).at(-1)![1]).toBe(0);
  });

  test('is not lowered by single pictures that take long', () => {
    const quality = new Quality(ALL);
    let pictures = 0;
    expect(draw(quality, 60, () => (++pictures % 55 === 0 ? 0.4 : 1 / 60))).toEqual([[0, 0]]);
  });

  test.each([0.05, 0.07, 0.1, 0.15])('is lowered within seconds until 30 pictures per second are drawn, but for tries, where the best takes %d s', (best) => {
    const quality = new Quality(ALL);
    const takes = (index: number) => best * 0.7 ** index;
    let slow = 0;
    draw(quality, 216, (index, now) => {
      if (now > 16 && 1 / takes(index) < 28.5) slow += takes(index);
      return takes(index);
    });
    expect(slow / 200).toBeLessThan(0.12);
  });

  test('ends at the cheapest where nothing is enough', () => {
    const quality = new Quality(ALL);
    draw(quality, 60, () => 0.4);
    expect(quality.level).toBe(ALL.at(-1));
    expect(quality.picture(0.4)).toBe(false);
  });

  test('comes back when what took the time is over', () => {
    const quality = new Quality(ALL);
    draw(quality, 100, (_, now) => (now < 10 ? 0.05 : 1 / 60));
    expect(quality.index).toBe(0);
  });

  test('does not go to and fro: a better picture that fails is tried ever more seldom', () => {
    const quality = new Quality(ALL);
    const log = draw(quality, 600, (index) => (index < 2 ? 0.04 : 1 / 60));
    expect(quality.index).toBeGreaterThan(0);
    const tries = log.filter(([, index], i) => i > 0 && index < log[i - 1]![1]).map(([at]) => at);
    expect(tries.length).toBeLessThan(9);
    expect(tries.at(-1)! - tries.at(-2)!).toBeGreaterThan(60);
  });

  test('held, never changes; pictures before a rest do not count', () => {
    const quality = new Quality(ALL);
    quality.hold(3);
    draw(quality, 20, () => 0.2);
    expect(quality.index).toBe(3);
    const rested = new Quality(ALL);
    for (let i = 0; i < 50; i++) {
      for (let slow = 0; slow < 25; slow++) expect(rested.picture(0.1)).toBe(false);
      rested.rest();
    }
  });
});
