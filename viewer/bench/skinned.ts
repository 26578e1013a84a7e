/** What skinning costs: frames of a body on a skeleton that moves, against frames of the same splats at rest. */
import { expect, test } from 'vitest';
import { makeSkinned } from '../support/references/skinned.ts';
import { compare, SAME } from './compare.ts';

const GAUSSIANS = 6000;
const MOST_COST = 1.2; // of the still scene

test('a body on a skeleton against the same splats at rest', async () => {
  const { likeness, cost } = await compare(makeSkinned({ gaussians: GAUSSIANS, times: [] }).folder, 'skinned.ts');
  expect(likeness).toBeGreaterThan(SAME);
  expect(cost, 'frame time of the still scene, on a machine without other work').toBeLessThan(MOST_COST);
});
