import { describe, expect, test } from 'vitest';
import { checkAnimation } from '../../src/bundle/animation.ts';
import type { AnyBody } from '../../src/bundle/manifest.ts';
import { DISPLAY_LEAD } from '../../src/face/face.ts';
import { MotionDirector, type Spoken } from '../../src/motion/director.ts';
import { SpeechPath } from '../../src/motion/path.ts';

const TICK = 1 / 30;
const ANIMATION = { version: 1, fps: 15, num_frames: 46, rest: { start: 3, end: 18 }, actions: [], min_speed: 0.6, max_speed: 1.2 };
const [START, END, LAST] = [0.2, 1.2, 3];

/** A person whose sound and time are played by the test. */
class Rehearsal {
  now = 0;
  readonly log: { now: number; time: number; sound: number | null }[] = [];
  readonly director = new MotionDirector(ANIMATION, () => this.spoken());
  private voice: { utterance: number; began: number } | null = null;

  /** Sound of an utterance is heard from now on. */
  speak(utterance: number): void {
    this.voice = { utterance, began: this.now };
  }

  silence(): void {
    this.voice = null;
  }

  /** Runs for some seconds; what the body did. */
  run(seconds: number, tick = TICK): typeof this.log {
    const begin = this.log.length;
    for (const end = this.now + seconds - 1e-9; this.now < end; ) {
      this.now += tick;
      this.director.advance(tick, { time: this.director.time, waiting: false });
      this.log.push({ now: this.now, time: this.director.time, sound: this.spoken()?.seconds ?? null });
    }
    return this.log.slice(begin);
  }

  /** Largest speed of all that was seen, body seconds per second. */
  get fastest(): number {
    const speeds = this.log.slice(1).map(({ now, time }, i) => Math.abs(time - this.log[i]!.time) / (now - this.log[i]!.now));
    return Math.max(...speeds);
  }

  private spoken(): Spoken | null {
    return this.voice && { utterance: this.voice.utterance, seconds: this.now - this.voice.began };
  }
}

const times = (log: { time: number }[]) => log.map(({ time }) => time);
const inRest = (time: number) => time >= START - 1e-9 && time <= END + 1e-9;

describe('in silence', () => {
  test('the body goes back and forth in the rest span, as fast as captured, with eased turns', () => {
    const rehearsal = new Rehearsal();
    const seen = times(rehearsal.run(10));
    expect(seen.every(inRest)).toBe(true);
    expect(Math.min(...seen)).toBeCloseTo(START, 6);
    expect(Math.max(...seen)).toBeCloseTo(END, 6);
    expect(rehearsal.fastest).toBeCloseTo(1, 6);
    const steps = seen.slice(1).map((time, i) => time - seen[i]!);
    const turns = steps.filter((step, i) => i > 0 && step * steps[i - 1]! < 0);
    expect(turns.length).toBeGreaterThanOrEqual(7);
    for (let i = 1; i < steps.length; i++) expect(Math.abs(steps[i]! - steps[i - 1]!)).toBeLessThan(0.25 * TICK);
  });

  test('the plan is the loop', () => {
    const { director } = new Rehearsal();
    expect(director.stops()).toEqual([END, START]);
  });

  test('a held pose stays', () => {
    const rehearsal = new Rehearsal();
    rehearsal.run(0.5);
    rehearsal.director.hold(2.5);
    rehearsal.director.plan(0, [[0, 1], [1, 2]]);
    rehearsal.speak(0);
    expect(new Set(times(rehearsal.run(1)))).toEqual(new Set([2.5]));
    expect(rehearsal.director.stops()).toEqual([]);
  });
});

describe('while it speaks', () => {
  const plan: [number, number][] = [[0, 0.9], [0.6, 1.2], [2.1, 2.7], [3, 2.7], [4, 1.8], [5, 1.2]];

  /** Where the plan wants the body at a time of the sound. */
  function wanted(seconds: number): number {
    const path = new SpeechPath();
    path.add(plan);
    return path.at(seconds + DISPLAY_LEAD).time;
  }

  test('the body follows the plan on the clock of the sound, then returns to rest', () => {
    const rehearsal = new Rehearsal();
    rehearsal.run(2);
    rehearsal.director.plan(7, plan);
    rehearsal.speak(7);
    const spoken = rehearsal.run(4.9);
    for (const { sound, time } of spoken.filter((row) => row.sound! > 2.6)) expect(time).toBeCloseTo(wanted(sound!), 6);
    const held = spoken.filter(({ sound }) => sound! > 2.6 && sound! < 2.9);
    expect(new Set(times(held))).toEqual(new Set([2.7]));
    expect(Math.max(...times(spoken))).toBeGreaterThan(2.6);
    rehearsal.silence();
    expect(times(rehearsal.run(6)).slice(15).every(inRest)).toBe(true);
    expect(rehearsal.fastest).toBeLessThanOrEqual(1.2 + 1e-9);
  });

  test('what is planned tells which windows are next', () => {
    const { director, ...rest } = new Rehearsal();
    expect(rest.now).toBe(0);
    director.plan(0, plan);
    const rehearsal = new Rehearsal();
    rehearsal.director.plan(0, plan);
    rehearsal.speak(0);
    rehearsal.run(1);
    const stops = rehearsal.director.stops();
    expect(stops[0]).toBeCloseTo(wanted(1), 6);
    expect(stops.slice(1)).toEqual([2.7, 2.7, 1.8, 1.2, END]);
  });

  test.each([0.3, 0.9, 1.4, 1.97, 2.5, 3.6])('stopped after %d s, it returns from where it is', (seconds) => {
    const rehearsal = new Rehearsal();
    rehearsal.run(1);
    rehearsal.director.plan(0, plan);
    rehearsal.speak(0);
    const from = rehearsal.run(seconds).at(-1)!.time;
    rehearsal.silence();
    const back = times(rehearsal.run(6));
    expect(Math.abs(back[0]! - from)).toBeLessThanOrEqual(1.2 * TICK);
    expect(rehearsal.fastest).toBeLessThanOrEqual(1.2 + 1e-9);
    const home = back.findIndex(inRest);
    expect(back.slice(home).every(inRest)).toBe(true);
    expect(home * TICK).toBeLessThan((from - END) / 0.6 + 0.6); // no slower than allowed, but for the turn
    if (from > END + 0.3) expect(back[home + 6]! - back[home]!).toBeCloseTo(-6 * TICK, 6); // straight into the loop
  });

  test('a plan that comes late is caught up with, in the middle of a gesture', () => {
    const rehearsal = new Rehearsal();
    rehearsal.run(1);
    rehearsal.speak(0);
    expect(times(rehearsal.run(2)).every(inRest)).toBe(true);
    rehearsal.director.plan(0, plan);
    rehearsal.run(1.9);
    expect(rehearsal.director.time).toBeCloseTo(wanted(3.9), 6);
    expect(rehearsal.fastest).toBeLessThanOrEqual(1.2 + 1e-9);
  });

  test('without a plan it rests', () => {
    const rehearsal = new Rehearsal();
    rehearsal.director.plan(3, plan);
    rehearsal.director.plan(4, []);
    rehearsal.speak(4);
    expect(times(rehearsal.run(5)).every(inRest)).toBe(true);
  });

  test('points that are missing hold the pose; those that come replace what was planned', () => {
    const rehearsal = new Rehearsal();
    rehearsal.director.plan(0, [[0, 0.3], [1, 1.3], [9, 3]]);
    rehearsal.director.plan(0, [[1, 1.3], [2, 2.3]]);
    rehearsal.speak(0);
    rehearsal.run(2.5);
    expect(new Set(times(rehearsal.run(0.5)))).toEqual(new Set([2.3]));
    rehearsal.director.plan(0, [[3.5, 2.3], [4, 2.8]]);
    rehearsal.run(1);
    expect(rehearsal.director.time).toBeCloseTo(2.8, 6);
  });

  test('one utterance after the other, without a jump', () => {
    const rehearsal = new Rehearsal();
    rehearsal.director.plan(0, plan);
    rehearsal.director.plan(1, [[0, 1.2], [3, 3], [6, 0]]);
    rehearsal.speak(0);
    rehearsal.run(1.6);
    rehearsal.speak(1);
    rehearsal.run(6.5);
    expect(rehearsal.director.time).toBeCloseTo(0, 6);
    rehearsal.silence();
    expect(times(rehearsal.run(3)).slice(30).every(inRest)).toBe(true);
    expect(rehearsal.fastest).toBeLessThanOrEqual(1.2 + 1e-9);
  });

  test('a new session begins without the plans of the old one', () => {
    const rehearsal = new Rehearsal();
    rehearsal.director.plan(0, plan);
    rehearsal.director.reset();
    rehearsal.speak(0);
    expect(times(rehearsal.run(4)).every(inRest)).toBe(true);
  });

  test('a plan that asks too much is kept within the limits', () => {
    const rehearsal = new Rehearsal();
    rehearsal.director.plan(0, [[0, 0], [0.5, 3], [1, -9], [1.5, 99], [6, 99]]);
    rehearsal.speak(0);
    const seen = times(rehearsal.run(6));
    expect(rehearsal.fastest).toBeLessThanOrEqual(1.2 + 1e-9);
    expect(Math.min(...seen)).toBeGreaterThanOrEqual(0);
    expect(seen.at(-1)).toBe(LAST);
  });

  test.each([1 / 144, 1 / 60, 0.1, 0.25])('at ticks of %d s as well', (tick) => {
    const rehearsal = new Rehearsal();
    rehearsal.run(2, tick);
    rehearsal.director.plan(0, plan);
    rehearsal.speak(0);
    const spoken = rehearsal.run(5, tick);
    for (const { sound, time } of spoken.filter((row) => row.sound! > 3)) expect(time).toBeCloseTo(wanted(sound!), 6);
    rehearsal.silence();
    expect(times(rehearsal.run(6, tick)).filter((_, i) => i * tick > 0.5).every(inRest)).toBe(true);
    expect(rehearsal.fastest).toBeLessThanOrEqual(1.2 + 1e-9);
  });
});

describe('a damaged animation is refused in one sentence', () => {
  const body: AnyBody = { fps: 15, frames: 46, low: [0, 0, 0], high: [1, 1, 1] };
  test('while a good one is taken', () => expect(checkAnimation(ANIMATION, body)).toBe(ANIMATION));
  const cases: [string, unknown, RegExp][] = [
    ['nothing', null, /^animation.json: version is missing or does not fit the body\.$/],
    ['another version', { ...ANIMATION, version: 2 }, /version/],
    ['another rate', { ...ANIMATION, fps: 25 }, /fps/],
    ['another length', { ...ANIMATION, num_frames: 45 }, /num_frames/],
    ['no rest', { ...ANIMATION, rest: null }, /rest/],
    ['rest beyond the end', { ...ANIMATION, rest: { start: 3, end: 46 } }, /rest/],
    ['rest backwards', { ...ANIMATION, rest: { start: 9, end: 3 } }, /rest/],
    ['half a frame', { ...ANIMATION, rest: { start: 0.5, end: 3 } }, /rest/],
    ['no speed', { ...ANIMATION, min_speed: 0 }, /min_speed/],
    ['limits crossed', { ...ANIMATION, max_speed: 0.5 }, /max_speed/],
    ['endless speed', { ...ANIMATION, max_speed: Infinity }, /max_speed/],
  ];
  test.each(cases)('%s', (_, value, sentence) => expect(() => checkAnimation(value, body)).toThrow(sentence));
});

test('of a plan without an end the points are kept that a server plans at most', () => {
  const path = new SpeechPath();
  path.add(Array.from({ length: 20_000 }, (_, i) => [i / 100, i / 100] as [number, number]));
  expect(path.after(-1)).toHaveLength(10_000);
  path.add([[5, 1]]); // replaces what was planned from then on
  expect(path.after(-1)).toHaveLength(501);
});
