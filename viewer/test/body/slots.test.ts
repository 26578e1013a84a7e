import { describe, expect, test } from 'vitest';
import { FAR, NEAR, Slots, type Shown, type Slot } from '../../src/body/slots.ts';
import { Timeline } from '../../src/body/timeline.ts';
import type { WindowInfo } from '../../src/bundle/manifest.ts';
import { MotionDirector, type Spoken } from '../../src/motion/director.ts';
import type { Motion } from '../../src/motion/motion.ts';
import { Playback } from '../../src/motion/playback.ts';

const TICK = 1 / 30;
const SORT = 3 * TICK; // until what was put into a slot has been sorted

/** A body whose server, clock and GPU are played by the test. */
class Theatre {
  readonly timeline: Timeline;
  readonly playback: Playback;
  readonly slots: Slots<number>;
  readonly log: (Shown | null)[] = [];
  readonly fetched: number[] = [];
  readonly content: [number | null, number | null] = [null, null];
  failures = 0;
  broken = new Set<number>();
  now = 0;
  latency: number;
  mostAtOnce = 0;
  private readonly sortedAt: [number, number] = [0, 0];
  private waiting: { due: number; act: () => void }[] = [];
  private readonly motion: Motion;

  /** @param motion what moves the body; by default its playback there and back */
  constructor(lasts: number[], latency: number, motion?: Motion, reach = FAR) {
    this.timeline = new Timeline({ fps: 15, windows: lasts.map((last) => ({ last })) as WindowInfo[] });
    this.playback = new Playback(this.timeline.duration, true);
    this.motion = motion ?? this.playback;
    this.latency = latency;
    this.slots = new Slots<number>(this.timeline, reach, {
      load: (window) => this.load(window),
      put: (slot, window) => this.put(slot, window),
      settled: (slot) => this.now >= this.sortedAt[slot],
      failed: () => this.failures++,
    });
  }

  private load(window: number): Promise<number> {
    this.fetched.push(window);
    return new Promise((resolve, reject) => {
      const act = () => (this.broken.has(window) ? reject(new Error('lost')) : resolve(window));
      this.waiting.push({ due: this.now + this.latency, act });
      this.mostAtOnce = Math.max(this.mostAtOnce, this.waiting.length);
    });
  }

  private put(slot: Slot, window: number): void {
    expect(this.log.at(-1)?.slot).not.toBe(slot); // never into the one that is seen
    this.content[slot] = window;
    this.sortedAt[slot] = this.now + SORT;
  }

  /** Runs for some seconds and keeps what was shown. */
  async run(seconds: number): Promise<(Shown | null)[]> {
    const begin = this.log.length;
    for (const end = this.now + seconds; this.now < end; this.now += TICK) {
      for (const { act } of this.waiting.filter(({ due }) => due <= this.now)) act();
      this.waiting = this.waiting.filter(({ due }) => due > this.now);
      await new Promise((resolve) => setImmediate(resolve));
      const last = this.log.at(-1);
      if (last) this.motion.advance(TICK, last);
      const shown = this.slots.update(this.motion.time, this.motion.stops(), this.now);
      if (shown) {
        expect(this.content[shown.slot]).toBe(shown.window); // what is seen is there …
        expect(this.now).toBeGreaterThanOrEqual(this.sortedAt[shown.slot]); // … sorted …
        expect(this.timeline.contains(shown.window, shown.time)).toBe(true); // … and at a time of its own
      }
      this.log.push(shown);
    }
    return this.log.slice(begin);
  }
}

function jumps(log: (Shown | null)[]): number[] {
  const times = log.filter((shown) => shown !== null).map(({ time }) => time);
  return times.slice(1).map((time, i) => Math.abs(time - times[i]!));
}

describe('windows in two slots', () => {
  test('nothing is shown before the first window is there', async () => {
    const theatre = new Theatre([9, 18, 27], 0.5);
    const log = await theatre.run(2);
    const first = log.findIndex((shown) => shown !== null);
    expect(first * TICK).toBeGreaterThanOrEqual(0.5 + SORT - TICK);
    expect(log[first]).toMatchObject({ time: 0, window: 0, waiting: false });
    expect(theatre.fetched[0]).toBe(0);
  });

  test('played there and back through all borders without a gap when prefetch is in time', async () => {
    const theatre = new Theatre([9, 18, 27, 33], 0.25);
    const log = (await theatre.run(12)).filter((shown) => shown !== null);
    expect(log.every(({ waiting }) => !waiting)).toBe(true);
    for (const jump of jumps(log)) expect(jump).toBeLessThanOrEqual(TICK + 1e-9);
    const order = log.map(({ window }) => window).filter((window, i, all) => window !== all[i - 1]);
    expect(order.slice(0, 10)).toEqual([0, 1, 2, 3, 2, 1, 0, 1, 2, 3]);
    const slots = log.filter(({ window }, i) => window !== log[i - 1]?.window).map(({ slot }) => slot);
    slots.slice(1).forEach((slot, i) => expect(slot).not.toBe(slots[i]));
  });

  test('large windows come one at a time, the next one alone, and play without a gap all the same', async () => {
    const theatre = new Theatre([9, 18, 27, 33], 0.25, undefined, NEAR);
    const log = (await theatre.run(12)).filter((shown) => shown !== null);
    expect(log.every(({ waiting }) => !waiting)).toBe(true);
    expect(new Set(log.map(({ window }) => window))).toEqual(new Set([0, 1, 2, 3]));
    expect(theatre.mostAtOnce).toBe(1);
  });

  test('a late window: the old one stays at the border, then it goes on from there', async () => {
    const theatre = new Theatre([9, 18, 27, 36, 45, 54], 1.5);
    const log = (await theatre.run(12)).filter((shown) => shown !== null);
    const waits = log.filter(({ waiting }) => waiting);
    expect(waits.length).toBeGreaterThan(10);
    for (const { time, window } of waits) expect([0, 1]).toContain(theatre.timeline.tau(window, time));
    for (const jump of jumps(log)) expect(jump).toBeLessThanOrEqual(TICK + 1e-9);
    expect(log.some(({ window }) => window === 5)).toBe(true);
  });

  test('a seek keeps the old picture until the new window is there', async () => {
    const theatre = new Theatre([9, 18, 27, 36, 45, 54], 0.4);
    await theatre.run(1);
    theatre.playback.playing = false;
    theatre.playback.seek(3.3);
    const log = await theatre.run(2);
    const before = log.filter((shown) => shown!.waiting);
    expect(before.length * TICK).toBeGreaterThan(0.4);
    expect(new Set(before.map((shown) => shown!.window)).size).toBe(1);
    expect(log.at(-1)).toMatchObject({ time: 3.3, window: 5, waiting: false });
  });

  test('scrubbing wildly ends where it ends, and never floods the server', async () => {
    const theatre = new Theatre(Array.from({ length: 40 }, (_, i) => 9 * (i + 1)), 0.2);
    await theatre.run(1);
    theatre.playback.playing = false;
    for (let i = 0; i < 60; i++) {
      theatre.playback.seek((i * 7.77) % theatre.timeline.duration);
      await theatre.run(2 * TICK);
    }
    const wanted = theatre.playback.time;
    const log = await theatre.run(1.5);
    expect(log.at(-1)).toMatchObject({ time: wanted, waiting: false });
    expect(theatre.mostAtOnce).toBeLessThanOrEqual(3);
  });

  test('a window that cannot be fetched is tried again', async () => {
    const theatre = new Theatre([9, 18, 27], 0.1);
    theatre.broken.add(1);
    await theatre.run(4);
    expect(theatre.failures).toBeGreaterThanOrEqual(2);
    expect(theatre.log.at(-1)).toMatchObject({ window: 0, waiting: true });
    theatre.broken.clear();
    const log = await theatre.run(4);
    expect(log.some((shown) => shown!.window === 2)).toBe(true);
  });

  test('windows far away are forgotten and fetched again when they come back', async () => {
    const theatre = new Theatre(Array.from({ length: 12 }, (_, i) => 9 * (i + 1)), 0.1);
    await theatre.run(16); // to the end and back
    expect(theatre.fetched.filter((window) => window === 2).length).toBe(2);
    expect(theatre.fetched.length).toBeLessThan(30);
  });

  test('a person who rests in one window and gestures through others: each is there in time', async () => {
    const animation = { fps: 15, num_frames: 55, rest: { start: 11, end: 17 }, min_speed: 0.6, max_speed: 1.2 };
    let spoken: Spoken | null = null;
    const director = new MotionDirector(animation, () => spoken);
    const theatre = new Theatre([9, 18, 27, 36, 45, 54], 0.3, director);
    const rest = (await theatre.run(4)).filter((shown) => shown !== null);
    expect(new Set(rest.map(({ window }) => window))).toEqual(new Set([1]));
    expect(theatre.fetched.slice().sort()).toEqual([0, 1, 2]); // what is beside it waits

    // To the last window, back through all of them to the first, and to the rest.
    director.plan(0, [[0, 1], [3, 3.5], [3.5, 3.5], [7.5, 0], [8, 0.6]]);
    const begin = theatre.now;
    const motion = director.advance.bind(director);
    director.advance = (step, seen) => {
      spoken = { utterance: 0, seconds: theatre.now - begin };
      motion(step, seen);
    };
    const log = (await theatre.run(8)).filter((shown) => shown !== null);
    expect(log.every(({ waiting }) => !waiting)).toBe(true);
    const order = log.map(({ window }) => window).filter((window, i, all) => window !== all[i - 1]);
    expect(order).toEqual([1, 2, 3, 4, 5, 4, 3, 2, 1, 0]);
    for (const jump of jumps(log)) expect(jump).toBeLessThanOrEqual(1.2 * TICK + 1e-9);
  });

  test('a person whose windows are late waits at the border and goes on from there', async () => {
    const animation = { fps: 15, num_frames: 55, rest: { start: 0, end: 6 }, min_speed: 0.6, max_speed: 1.2 };
    const spoken = { utterance: 0, seconds: 0 };
    const director = new MotionDirector(animation, () => spoken);
    director.plan(0, [[0, 0], [3.6, 3.6]]);
    const theatre = new Theatre([9, 18, 27, 36, 45, 54], 2, director);
    const motion = director.advance.bind(director);
    director.advance = (step, seen) => {
      spoken.seconds += step; // the sound does not wait
      motion(step, seen);
    };
    const log = (await theatre.run(14)).filter((shown) => shown !== null);
    expect(log.some(({ waiting }) => waiting)).toBe(true);
    for (const jump of jumps(log)) expect(jump).toBeLessThanOrEqual(1.2 * TICK + 1e-9);
    expect(log.at(-1)!.time).toBe(3.6);
  });

  test('one window alone is played there and back', async () => {
    const theatre = new Theatre([9], 0.1);
    const log = (await theatre.run(4)).filter((shown) => shown !== null);
    expect(theatre.fetched).toEqual([0]);
    for (const jump of jumps(log)) expect(jump).toBeLessThanOrEqual(TICK + 1e-9);
  });
});
