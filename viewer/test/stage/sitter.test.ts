import { Box3, Matrix4, Vector3 } from 'three';
import { describe, expect, test } from 'vitest';
import type { HeadFiles } from '../../src/bundle/load.ts';
import type { HeadInfo, Manifest } from '../../src/bundle/manifest.ts';
import { STILL, type BakedHead } from '../../src/bundle/baked-head.ts';
import { eyesOf, sampled } from '../../src/head/eyes.ts';
import { sitterOf } from '../../src/stage/camera/sitter.ts';
import { random } from '../../support/random.ts';

const COUNT = 3000;
const EYES = { y: 0.02, z: 0.085, aside: 0.032 };
const info = { expression_size: 7, eye_offset: 0, expression_names: [], idle_expression: Array(7).fill(0), num_poses: 2 } as unknown as HeadInfo;

/** The shell of a head whose lids change strongly, and everything else a little, when it blinks. */
function makeHead(origin = 0, count = COUNT): BakedHead {
  const next = random(3);
  const means = new Float32Array(3 * count);
  const basis = new Int8Array(4 * count);
  for (let i = 0; i < count; i++) {
    const direction = new Vector3(next() - 0.5, next() - 0.5, next() - 0.5).normalize();
    const [x, y, z] = [0.08 * direction.x, 0.11 * direction.y, 0.09 * direction.z];
    const lid = Math.hypot(Math.abs(x) - EYES.aside, y - EYES.y) < 0.012 && z > 0;
    means.set([x, y + origin, z], 3 * i);
    basis.fill(lid ? 100 : Math.round(16 * (next() - 0.5)), 4 * i, 4 * i + 3);
  }
  const network = { inputs: 7, hidden: 1, outputs: 1, w1: new Float32Array([0, 0, 0, 0, 0, 0.5, 0.5]) };
  return {
    count: count,
    rank: 1,
    moves: 0,
    means,
    quats: new Float32Array(4 * count),
    scales: new Float32Array(3 * count),
    meanLogits: Float32Array.from({ length: 4 * count }, (_, i) => (i % 4 === 3 ? 3 : 0)),
    basis,
    basisScale: new Float32Array(count).fill(0.02),
    displacements: new Int8Array(0),
    moving: STILL,
    network: { ...network, b1: new Float32Array(1), w2: new Float32Array([1]), b2: new Float32Array(1) },
  };
}

describe('the eyes of a head', () => {
  test.each([-0.03, -0.02, 0, 0.02])('are where its lids close, with the origin %d m away', (origin) => {
    const [x, y, z] = eyesOf(makeHead(origin), info);
    expect(x).toBe(0);
    expect(Math.abs(y - EYES.y - origin)).toBeLessThan(0.004);
    expect(Math.abs(z - EYES.z)).toBeLessThan(0.02);
  });

  test('are where they usually are in a head that cannot blink', () => {
    const deaf = { ...info, eye_offset: null };
    expect(eyesOf(makeHead(), deaf)).toEqual([0, 0.01, 0.06]);
  });
});

test('Gaussians are chosen evenly where they are many, else all', () => {
  expect(sampled(10, (i) => i % 2 === 1)).toEqual([1, 3, 5, 7, 9]);
  const chosen = sampled(90_001, () => true);
  expect([chosen.length, chosen[1], chosen.at(-1)]).toEqual([18_001, 5, 90_000]);
});

describe('who sits before the camera', () => {
  const rigid = (x: number, y: number, turn: number) => new Matrix4().makeRotationY(turn).setPosition(x, y, 0.1).transpose().toArray();
  const poses = Float32Array.from([...rigid(-0.1, 1.5, -0.2), ...rigid(0.1, 1.5, 0.2)]);
  const files: HeadFiles = { info, baked: makeHead(), poses, shoulders: null };
  const camera = { eye: [0.5, 1.2, 3], target: [0, 0.8, 0], up: [0, 2, 0], fov_y: 30 };
  const body = { low: [-0.4, 0.02, -0.2], high: [0.4, 1.55, 0.5], windows: [{ last: 1 }] };
  const whole = sitterOf({ camera, body } as unknown as Manifest, files, [0, 1], false);
  const alone = sitterOf({ camera, body: null } as unknown as Manifest, files, [0, 1], false);

  test('their eyes are in the middle of where the head usually is', () => {
    for (const { eyes } of [whole, alone]) {
      expect(eyes.x).toBeCloseTo(0, 6);
      expect(Math.abs(eyes.y - 1.5 - EYES.y)).toBeLessThan(0.004);
    }
  });

  test('somebody with a body is met face to face, a head from where it was recorded', () => {
    expect(whole.toward.toArray()).toEqual([expect.closeTo(0, 6), 0, expect.closeTo(1, 6)]);
    expect(whole.up.toArray()).toEqual([0, 1, 0]);
    const recorded = new Vector3(0.5, 1.2, 3).sub(alone.eyes).normalize();
    expect(alone.toward.distanceTo(recorded)).toBeLessThan(1e-9);
  });

  test('whoever turns the head is met a little from the right', () => {
    const { toward, eyes } = sitterOf({ camera, body } as unknown as Manifest, files, [0, 1], true);
    const angle = (-18 * Math.PI) / 180;
    expect(toward.toArray()).toEqual([expect.closeTo(Math.sin(angle), 6), 0, expect.closeTo(Math.cos(angle), 6)]);
    const turned = eyes.clone().sub(whole.eyes).toArray(); // about the neck
    expect(turned).toEqual([expect.closeTo(0.09 * Math.sin(angle), 6), 0, expect.closeTo(0.09 * (Math.cos(angle) - 1), 6)]);
  });

  test('their extent is that of head and body', () => {
    expect(whole.crown).toBeCloseTo(0.11 - EYES.y, 2);
    expect(whole.lowest).toBeCloseTo(whole.eyes.y - 0.02, 6);
    expect(Math.abs(alone.lowest - 0.11 - EYES.y)).toBeLessThan(0.01); // less the strays
    const around = new Box3(new Vector3(-0.4, 0.02, -0.2), new Vector3(0.4, 1.6, 0.5));
    expect(whole.box.min.distanceTo(around.min)).toBeLessThan(1e-6);
    expect(whole.box.max.distanceTo(around.max)).toBeLessThan(0.02);
  });

  test('many Gaussians tell the same by a few of them', () => {
    const many = sitterOf({ camera, body } as unknown as Manifest, { ...files, baked: makeHead(0, 30 * COUNT) }, [0, 1], false);
    expect(many.eyes.distanceTo(whole.eyes)).toBeLessThan(0.005);
    expect(many.crown).toBeCloseTo(whole.crown, 2);
    expect(many.box.max.distanceTo(whole.box.max)).toBeLessThan(0.01);
  });

  test('strays do not count', () => {
    const strayed = makeHead();
    strayed.means.set([0, 9, -9], 0);
    const sitter = sitterOf({ camera, body: null } as unknown as Manifest, { info, baked: strayed, poses, shoulders: null }, [0], false);
    expect(sitter.crown).toBeCloseTo(0.11 - EYES.y, 2);
    expect(sitter.box.max.y).toBeLessThan(1.65);
  });
});
