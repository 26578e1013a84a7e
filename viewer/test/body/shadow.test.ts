import { expect, test } from 'vitest';
import type { BakedLamp } from '../../src/body/skinned/baked.ts';
import { ShadowMap } from '../../src/body/skinned/shadow.ts';
import { TABLE_ROW } from '../../src/body/skinned/skeleton.ts';

/** A lamp above one sphere that hangs on one joint. */
const LAMP: BakedLamp = {
  direction: Float32Array.of(0, 1, 0),
  strength: Float32Array.of(1, 1, 1),
  points: Int16Array.of(1000, 2000, 3000), // a tenth of a millimetre each
  joints: new Uint8Array(4),
  weights: Uint8Array.of(255, 0, 0, 0),
};

/** How many texels are dark once the sphere is drawn so many metres to a side. */
function dark(aside: number): number {
  const map = new ShadowMap(LAMP, 1);
  const table = new Float32Array(TABLE_ROW);
  table.set([1, 0, 0, aside, 0, 1, 0, 0, 0, 0, 1, 0]);
  map.draw(table);
  return map.depths.filter((depth) => depth > -1e8).length;
}

test('a sphere darkens the texels about it', () => {
  expect(dark(0)).toBeGreaterThan(0);
  expect(dark(100)).toBeGreaterThan(0);
});

test.each([1e8, 1e14, 1.2e14, 1e20, 3e38, Infinity, NaN])('one that is %d m away is not drawn, and drawing ends', (aside) => {
  expect(dark(aside)).toBe(0);
  expect(dark(-aside)).toBe(0);
});
