import { Quaternion, Vector3 } from 'three';
import { describe, expect, test } from 'vitest';
import { EyeMovement } from '../../src/gesture/performing/eye-movement.ts';
import type { StateMessage } from '../../src/protocol.ts';

const DEGREES = 180 / Math.PI;
const STEP = 0.02; // s
const GAZE = { eyes: [0, 0.02, 0.07] as [number, number, number], most: [0.21, 0.12] as [number, number] };
const STILL = { position: new Vector3(1, 1.5, -2), quaternion: new Quaternion().setFromAxisAngle(new Vector3(0, 1, 0), 0.7) };
const SEEDS = [1, 2, 3, 4];

/** Numbers from 0 to 1 that look random (Park and Miller). */
function numbers(seed: number): () => number {
  let state = seed;
  return () => (state = (48271 * state) % 2147483647) / 2147483647;
}

/** Where somebody stands for a head, degrees to its left and downwards of its own eyes, and metres away. */
function visitorAt(yaw: number, pitch: number, away: number, { position, quaternion } = STILL): Vector3 {
  const [left, down] = [yaw / DEGREES, pitch / DEGREES];
  const way = new Vector3(Math.cos(down) * Math.sin(left), -Math.sin(down), Math.cos(down) * Math.cos(left));
  return way.multiplyScalar(away).add(new Vector3(...GAZE.eyes)).applyQuaternion(quaternion).add(position);
}

/** How far eyes are turned, degrees, each `STEP` of some seconds. */
function turned(visitor: Vector3, seconds: number, seed: number, state: StateMessage['state'] = 'idle'): [number, number][] {
  const eyes = new EyeMovement(GAZE, () => visitor, seed, numbers(seed));
  eyes.attend(state);
  let [yaw, pitch] = [0, 0];
  return Array.from({ length: seconds / STEP }, () => {
    [yaw, pitch] = eyes.turn(STEP, STILL) ?? [yaw, pitch];
    return [yaw * DEGREES, pitch * DEGREES];
  });
}

function middle(values: number[]): number {
  return values.toSorted((a, b) => a - b)[values.length >> 1]!;
}

describe('eyes', () => {
  test.each([[0, 0], [8, 2], [-6, -3]])('hold a visitor %d° to the left and %d° down', (yaw, pitch) => {
    for (const seed of SEEDS) {
      const found = turned(visitorAt(yaw, pitch, 2), 60, seed);
      expect(Math.abs(middle(found.map(([left]) => left)) - yaw)).toBeLessThan(1);
      const downwards = middle(found.map(([, down]) => down)) - pitch;
      expect(downwards).toBeGreaterThan(-0.3);
      expect(downwards).toBeLessThan(2.1); // a mouth is looked at, too
    }
  });

  test('turn no farther than they were made to', () => {
    for (const [yaw, pitch] of [[70, 40], [-120, -30]] as const) {
      const found = turned(visitorAt(yaw, pitch, 1), 20, 5);
      for (const [left, down] of found) {
        expect(Math.abs(left)).toBeLessThanOrEqual(GAZE.most[0] * DEGREES + 1e-9);
        expect(Math.abs(down)).toBeLessThanOrEqual(GAZE.most[1] * DEGREES + 1e-9);
      }
      expect(middle(found.map(([left]) => left))).toBeCloseTo(Math.sign(yaw) * GAZE.most[0] * DEGREES, 6);
    }
  });

  test('stay on the visitor while the head turns', () => {
    const visitor = visitorAt(0, 0, 2);
    const eyes = new EyeMovement(GAZE, () => visitor, 1, () => 0.4); // never past somebody, and always at the mouth
    const held: number[] = [];
    let yaw = 0;
    for (let i = 0; i < 200; i++) {
      const swing = 0.1 * Math.sin(i / 30);
      const quaternion = new Quaternion().setFromAxisAngle(new Vector3(0, 1, 0), 0.7 + swing);
      yaw = (eyes.turn(STEP, { position: STILL.position, quaternion }) ?? [yaw])[0];
      held.push((yaw + swing) * DEGREES);
    }
    expect(Math.max(...held) - Math.min(...held)).toBeLessThan(0.5); // the eyes' own place moves with the head
  });

  test('jump from point to point in a twentieth of a second, and rest between', () => {
    const found = turned(visitorAt(0, 0, 1), 60, 3);
    const moves = found.map(([left, down], i) => i > 0 && Math.hypot(left - found[i - 1]![0], down - found[i - 1]![1]) > 0.05);
    const jumps = moves.filter((moves, i, all) => moves && !all[i - 1]).length;
    expect(jumps).toBeGreaterThan(20);
    expect(jumps).toBeLessThan(100);
    expect(moves.filter(Boolean).length / jumps).toBeLessThanOrEqual(4); // of 20 ms
  });

  test('look past the visitor more while speaking than while listening', () => {
    const shares = (['speaking', 'listening'] as const).map((state) => {
      const all = SEEDS.flatMap((seed) => turned(visitorAt(0, 0, 2), 120, seed, state));
      return all.filter(([left]) => Math.abs(left) > 4).length / all.length;
    });
    expect(shares[0]).toBeGreaterThan(0.08);
    expect(shares[0]).toBeLessThan(0.3);
    expect(shares[1]).toBeLessThan(0.08);
    expect(shares[1]).toBeGreaterThan(0);
  });

  test('go aside and up at once where somebody thinks, the same side as the head', () => {
    for (const seed of SEEDS) {
      const [left, down] = turned(visitorAt(0, 0, 2), 2, seed, 'thinking').at(-1)!;
      expect(Math.abs(left)).toBeCloseTo(GAZE.most[0] * DEGREES, 6);
      expect(down).toBeCloseTo(-GAZE.most[1] * DEGREES, 6);
    }
  });

  test('tell nothing while nothing moves', () => {
    const eyes = new EyeMovement(GAZE, () => visitorAt(3, 1, 2), 1, () => 0.4);
    const told = Array.from({ length: 200 }, () => eyes.turn(STEP, STILL) !== null);
    expect(told[0]).toBe(true);
    expect(told.slice(10).filter(Boolean).length).toBe(0);
  });
});
