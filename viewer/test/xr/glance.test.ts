import { Quaternion, Vector3 } from 'three';
import { expect, test } from 'vitest';
import type { Meeting } from '../../src/stage/camera/meeting.ts';
import { Glance } from '../../src/xr/glance.ts';

const up = new Vector3(0, 0, 1);
const toward = new Vector3(0, -1, 0);
const eyes = new Vector3(1, 2, 3);
const meeting: Meeting = { ground: { foot: eyes, up, toward }, stands: false, eyes, local: null };

/** Where the eyes are, and where they look, after some seconds of a visitor at a place. */
function looking(visitor: Vector3, seconds: number): [Vector3, Vector3] {
  const glance = new Glance(meeting);
  for (let i = 0; i < 50 * seconds; i++) glance.look(visitor, 0.02);
  const [[w, x, y, z], shift] = glance.motion();
  const turn = new Quaternion(x, y, z, w);
  return [eyes.clone().applyQuaternion(turn).add(new Vector3(...shift)), toward.clone().applyQuaternion(turn)];
}

test('a head without a body looks at the visitor, and stays on its neck', () => {
  const visitor = eyes.clone().addScaledVector(toward, 1).add(new Vector3(0.5, 0, 0.05));
  const [at, look] = looking(visitor, 4);
  expect(look.angleTo(visitor.clone().sub(at))).toBeLessThan(0.05);
  const neck = eyes.clone().addScaledVector(up, -0.1);
  expect(at.distanceTo(neck)).toBeCloseTo(0.1, 9);
});

test('it turns as far as heads turn, and not at once', () => {
  const aside = eyes.clone().add(new Vector3(2, 0.2, 0));
  const [, look] = looking(aside, 5);
  expect(look.angleTo(toward)).toBeLessThan(1.3);
  expect(look.angleTo(toward)).toBeGreaterThan(1.1);
  expect(looking(aside, 0.1)[1].angleTo(toward)).toBeLessThan(0.2);
});
