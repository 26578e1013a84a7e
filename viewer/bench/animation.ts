/**
 * What animation costs: frames of a whole person who speaks and gestures, against frames of the
 * same splats that stand still behind an identity modifier and are updated each tick as well.
 */
import { expect, test } from 'vitest';
import { makePerson } from '../support/references/person.ts';
import { quantile } from '../support/statistics.ts';
import { compare, SAME } from './compare.ts';
import type { Frame } from './page/drawing.ts';

const GAUSSIANS = '3500,2500'; // on the head, on the body
const MOST_COST = 1.15; // of the still scene
const LONGEST = 3; // of the median

test('an animated person against the same splats at rest', async () => {
  const { animated, still, likeness, cost } = await compare(makePerson({ gaussians: GAUSSIANS }).folder, 'scenes.ts');
  const changing = animated.map((frame, i) =>
    animated.slice(Math.max(0, i - 1), i + 2).some(({ window, uploaded }) => uploaded || window !== frame.window),
  );
  const times = (frames: Frame[]) => frames.map(({ ms }) => ms);
  const [moving, standing] = [times(animated), times(still)];
  const median = quantile(moving, 0.5);
  const changes = times(animated.filter((_, i) => changing[i]));
  const longest = Math.max(...changes) / median;
  const noise = Math.max(...standing) / quantile(standing, 0.5); // what the machine does to any frame
  console.log(
    `${changes.length} frames around window changes: median ×${(quantile(changes, 0.5) / median).toFixed(2)} of all, ` +
      `longest ×${longest.toFixed(2)} (at most ×${LONGEST}); longest of the still scene ×${noise.toFixed(2)}`,
  );
  expect(likeness).toBeGreaterThan(SAME);
  expect(changes.length).toBeGreaterThan(4);
  expect(cost, 'frame time of the still scene, on a machine without other work').toBeLessThan(MOST_COST);
  expect(longest).toBeLessThan(Math.max(LONGEST, noise));
});
