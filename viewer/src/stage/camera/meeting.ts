import * as THREE from 'three';
import type { Ground } from './ground.ts';
import { groundUnder } from './subject.ts';
import type { Sitter } from './sitter.ts';

const SEATED = 1.2; // m from the floor to the eyes of somebody who sits
const OVER_EYES = 0.12; // m from the eyes to the top of somebody's hair

/** Somebody as one meets them who is in the same world: life size, on a floor. */
export interface Meeting {
  ground: Ground;
  stands: boolean; // with feet on it
  eyes: THREE.Vector3; // the point between them at rest, world space
  local: THREE.Vector3 | null; // the same point in the head's own space; null where no head is told
}

/**
 * Somebody with a face. A head alone is as high as that of somebody who sits.
 *
 * @param local the point between the eyes in the head's own space
 */
export function meetingOf(sitter: Sitter, local: THREE.Vector3, stands: boolean): Meeting {
  const { eyes, up } = sitter;
  const standing = groundUnder(sitter);
  const ground = stands ? standing : { ...standing, foot: eyes.clone().addScaledVector(up, -SEATED) };
  return { ground, stands, eyes, local };
}

/** A body whose head is nowhere told: `height` m high. */
export function meetingOfBody(ground: Ground, height: number): Meeting {
  const eyes = ground.foot.clone().addScaledVector(ground.up, height - OVER_EYES);
  return { ground, stands: true, eyes, local: null };
}
