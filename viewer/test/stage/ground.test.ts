import { Vector3 } from 'three';
import { expect, test } from 'vitest';
import { footprintOf, type Ground } from '../../src/stage/camera/ground.ts';

const BLUR = 0.2; // m
const WIDTH = 0.04; // m from the middle of a foot to where its sides count: a twentieth of all may be strays
const DEPTH = 0.108; // m
const EDGE = 0.06; // m
const ground: Ground = { foot: new Vector3(1, 0.5, 2), up: new Vector3(0, 1, 0), toward: new Vector3(0, 0, 1) };

/** Two feet of 0.24 × 0.1 m beside each other, `apart` m between their middles, and hands over them. */
function standing(apart: number, shift = new Vector3(), turn = 0): Float32Array {
  const points: Vector3[] = [];
  for (const foot of [-apart / 2, apart / 2]) {
    for (let i = 0; i <= 20; i++) {
      for (let k = 0; k <= 20; k++) points.push(new Vector3(foot - 0.05 + 0.005 * i, 0.02, -0.12 + 0.012 * k));
    }
    points.push(new Vector3(10 * foot, 0.8, 0));
  }
  return Float32Array.from(points.flatMap((point) => point.applyAxisAngle(ground.up, turn).add(ground.foot).add(shift).toArray()));
}

test('the shadow is as wide and as deep as the feet, and what it blurs', () => {
  const { middle, size } = footprintOf(standing(0.2), ground)!;
  expect(middle.distanceTo(ground.foot)).toBeLessThan(1e-3);
  expect(size[0]).toBeCloseTo(Math.hypot(0.1 + WIDTH, BLUR), 2);
  expect(size[1]).toBeCloseTo(Math.hypot(DEPTH, BLUR), 2);
  expect(footprintOf(standing(0.6), ground)!.size[0]).toBeCloseTo(Math.hypot(0.3 + WIDTH, BLUR), 2);
});

test('it goes where they go, and turns with where somebody faces', () => {
  const shift = new Vector3(0.4, 0, -0.3);
  expect(footprintOf(standing(0.2, shift), ground)!.middle.distanceTo(ground.foot.clone().add(shift))).toBeLessThan(1e-3);
  const turned = footprintOf(standing(0.6, new Vector3(), Math.PI / 2), ground)!;
  expect(turned.size[0]).toBeLessThan(turned.size[1]);
  const facing = footprintOf(standing(0.6, new Vector3(), Math.PI / 2), { ...ground, toward: new Vector3(1, 0, 0) })!;
  expect(facing.size[0]).toBeCloseTo(Math.hypot(0.3 + WIDTH, BLUR), 2);
});

test('there is none under somebody who does not reach the floor', () => {
  expect(footprintOf(standing(0.2, new Vector3(0, 0.3, 0)), ground)).toBeNull();
});

test('each foot on the floor has a shadow of its own, and one in the air none', () => {
  const { soles } = footprintOf(standing(0.3), ground)!;
  expect(soles.map(({ middle }) => middle.x - ground.foot.x)).toEqual([expect.closeTo(-0.15, 3), expect.closeTo(0.15, 3)]);
  for (const { size } of soles) {
    expect(size[0]).toBeCloseTo(Math.hypot(0.045, EDGE), 2);
    expect(size[1]).toBeCloseTo(Math.hypot(DEPTH, EDGE), 2);
  }
  const lifted = standing(0.3);
  for (let at = 0; at < lifted.length; at += 3) if (lifted[at]! > ground.foot.x) lifted[at + 1]! += 0.08;
  const [standingOn, ...others] = footprintOf(lifted, ground)!.soles;
  expect(standingOn!.middle.x - ground.foot.x).toBeCloseTo(-0.15, 3);
  expect(others).toEqual([]);
});
