import { expect, test } from 'vitest';
import { headInThumbnail } from '../../src/ui/portrait.ts';
import type { HeadInfo, Manifest, SkinnedInfo } from '../../src/bundle/manifest.ts';

type Told = Parameters<typeof headInThumbnail>[0];

/** Somebody 1.8 m high before a camera that sees 2 m of height at their place. */
function standing(camera: Partial<Manifest['camera']> = {}, aside = 0): Told {
  const fov_y = (2 * Math.atan(1 / 4) * 180) / Math.PI;
  return {
    camera: { eye: [0, 0.9, 4], target: [0, 0.9, 0], up: [0, 1, 0], fov_y, ...camera },
    head: {} as HeadInfo,
    body: null,
    skinned: { low: [aside - 0.3, 0, -0.2], high: [aside + 0.3, 1.8, 0.2] } as SkinnedInfo,
  };
}

test('the thumbnail of somebody with a body is cut to half a metre, from a little over the head on', () => {
  const crop = headInThumbnail(standing())!;
  expect(crop.side).toBeCloseTo(0.25);
  expect(crop.left).toBeCloseTo(0.375); // the middle of the picture
  expect(crop.top).toBeCloseTo(0.5 - 0.95 / 2);
});

test('who stands aside is found there, as far as the picture goes', () => {
  expect(headInThumbnail(standing({}, 0.4))!.left).toBeCloseTo(0.375 + 0.2);
  expect(headInThumbnail(standing({}, 5))!.left).toBe(0.75);
});

test('a camera on its side finds the head at the side', () => {
  const crop = headInThumbnail({ ...standing({ eye: [0.9, 0, 4], target: [0.9, 0, 0], up: [1, 0, 0] }), skinned: { low: [0, -0.3, -0.2], high: [1.8, 0.3, 0.2] } as SkinnedInfo })!;
  expect(crop.top).toBeCloseTo(0.025);
  expect(crop.left).toBeCloseTo(0.375);
});

test('a head alone, and a body whose head is nowhere told, are shown whole', () => {
  expect(headInThumbnail({ ...standing(), skinned: null })).toBeNull();
  expect(headInThumbnail({ ...standing(), head: null })).toBeNull();
});
