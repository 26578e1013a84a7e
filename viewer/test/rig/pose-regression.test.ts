import { describe, expect, test } from 'vitest';
import { PoseRegression } from '../../src/rig/pose-regression.ts';

/** Poses (P,1,4) of one joint that is turned about x. */
function bent(...angles: number[]): Float64Array {
  return Float64Array.from(angles.flatMap((angle) => [Math.cos(angle / 2), Math.sin(angle / 2), 0, 0]));
}

/** The values that it finds for an angle. */
function at(regression: PoseRegression, angle: number, size: number): number[] {
  const out = new Float64Array(size);
  regression.at(bent(angle), out);
  return Array.from(out);
}

describe('values of any pose out of those of a few', () => {
  test('are what two poses tell, by hand', () => {
    const [side, width] = [Math.sin(0.25), 0.4];
    const found = new PoseRegression({ count: 2, rotations: bent(-0.5, 0.5), values: Float64Array.of(1, 3), width });
    const alike = (apart: number) => Math.exp(-(apart ** 2) / (2 * width ** 2));
    for (const angle of [0, 0.2, -0.4]) {
      const here = Math.sin(angle / 2);
      const expected = 2 + (alike(here - side) - alike(here + side)) / (1 + 0.01 - alike(2 * side));
      expect(at(found, angle, 1)[0]).toBeCloseTo(expected, 12);
    }
  });

  test('go on smoothly between known poses, several at once', () => {
    const angles = Array.from({ length: 11 }, (_, i) => -1.5 + 0.3 * i);
    const values = Float64Array.from(angles.flatMap((angle) => [Math.sin(2 * angle), 10 * Math.cos(angle)]));
    const found = new PoseRegression({ count: 11, rotations: bent(...angles), values, width: 0.6 });
    for (const angle of [-1.35, -0.45, 0.15, 1.05]) {
      const [sine, cosine] = at(found, angle, 2);
      expect(Math.abs(sine! - Math.sin(2 * angle))).toBeLessThan(0.06);
      expect(Math.abs(cosine! - 10 * Math.cos(angle))).toBeLessThan(0.5);
    }
  });

  test('are the mean far from all, and never leave the range', () => {
    const found = new PoseRegression({ count: 3, rotations: bent(0, 0.02, 0.05), values: Float64Array.of(0, 1, 5), width: 0.03 });
    expect(at(found, 3, 1)[0]).toBeCloseTo(2, 6);
    for (let angle = -0.2; angle < 0.2; angle += 0.01) {
      const [value] = at(found, angle, 1);
      expect(value! >= 0 && value! <= 5).toBe(true);
    }
  });

  test('of one pose hold everywhere', () => {
    const found = new PoseRegression({ count: 1, rotations: bent(0.3), values: Float64Array.of(7), width: 1 });
    expect(at(found, -2, 1)).toEqual([7]);
  });
});
