import { expect, test } from 'vitest';
import { Attention } from '../../src/gesture/performing/attention.ts';
import { Gaze } from '../../src/gesture/performing/gaze.ts';
import { rotate, type Vector } from '../../src/rig/quaternions.ts';

const DEGREES = 180 / Math.PI;
const SEEDS = Array.from({ length: 40 }, (_, seed) => seed);

/** Direction in which a face looks, and that from its chin to its forehead, two seconds after the gaze was told. */
function held(attention: Attention, from: number): { looks: Vector; up: Vector } {
  const gaze = new Gaze();
  for (let time = from; time <= from + 2; time += 0.02) {
    gaze.look(0, 0, attention.at(time));
    gaze.at(time - from);
  }
  const [chest, neck, head] = gaze.at(2);
  const turned = (way: Vector) => rotate(chest, rotate(neck, rotate(head, way)));
  return { looks: turned([0, 0, 1]), up: turned([0, 1, 0]) };
}

test('who listens tilts the head and looks at the visitor', () => {
  const sides = SEEDS.map((seed) => {
    const attention = new Attention(seed);
    attention.attend('listening', 3);
    const { looks, up } = held(attention, 3);
    expect(looks[2]).toBeCloseTo(1, 9);
    expect(DEGREES * Math.acos(up[1])).toBeCloseTo(5, 0);
    return Math.sign(up[0]);
  });
  expect(new Set(sides)).toEqual(new Set([-1, 1]));
});

test('who thinks looks past the visitor and up, and back once the answer is there', () => {
  const attention = new Attention(7);
  attention.attend('thinking', 0);
  const { looks } = held(attention, 0);
  expect(DEGREES * Math.atan2(Math.abs(looks[0]), looks[2])).toBeCloseTo(17, 0);
  expect(DEGREES * Math.asin(looks[1])).toBeCloseTo(8, 0);
  attention.attend('speaking', 2);
  expect(held(attention, 2).looks[2]).toBeCloseTo(1, 9);
});

test('a quick answer needs no look away, and a state that is told twice begins once', () => {
  const attention = new Attention(1);
  attention.attend('thinking', 10);
  attention.attend('thinking', 10.3);
  expect(attention.at(10.34)).toEqual({ yaw: 0, pitch: 0, tilt: 0 });
  expect(attention.at(10.36).pitch).toBeLessThan(-0.1);
});

test('from one thought to the next the side is another one at random', () => {
  const attention = new Attention(3);
  const sides = SEEDS.map((n) => {
    attention.attend('idle', n);
    attention.attend('thinking', n);
    return Math.sign(attention.at(n + 0.5).yaw);
  });
  expect(sides.filter((side) => side > 0).length).toBeGreaterThan(10);
  expect(sides.filter((side) => side < 0).length).toBeGreaterThan(10);
});
