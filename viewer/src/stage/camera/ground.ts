import { Vector3 } from 'three';

/** Where somebody stands, world space. */
export interface Ground {
  foot: Vector3; // on the floor, under the middle of the body
  up: Vector3; // of the world, of length 1
  toward: Vector3; // where the person faces, level, of length 1
}

/** The shadow of somebody's feet: an ellipse along the side and the front of who stands there. */
export interface Footprint {
  middle: Vector3; // on the floor
  size: [aside: number, ahead: number]; // m from the middle to where it has faded to a third
}

const LOW = 0.15; // m over the floor: feet, and what trails
const STRAYS = 0.05; // share of the points, at either end, that may lie anywhere
const BLUR = 0.2; // m by which it fades beyond the feet

/**
 * Where a shadow lies under somebody.
 *
 * @param points (N,3) of the person in the world, m
 * @returns null where nothing of the person is near the floor
 */
export function footprintOf(points: Float32Array, { foot, up, toward }: Ground): Footprint | null {
  const side = new Vector3().crossVectors(up, toward);
  const [aside, ahead]: [number[], number[]] = [[], []];
  const point = new Vector3();
  for (let at = 0; at < points.length; at += 3) {
    point.fromArray(points, at).sub(foot);
    if (point.dot(up) > LOW) continue;
    aside.push(point.dot(side));
    ahead.push(point.dot(toward));
  }
  if (aside.length === 0) return null;
  const [[x, width], [z, depth]] = [extent(aside), extent(ahead)];
  const middle = foot.clone().addScaledVector(side, x).addScaledVector(toward, z);
  return { middle, size: [Math.hypot(width, BLUR), Math.hypot(depth, BLUR)] };
}

/** Middle of values, and how far they reach from it. */
function extent(values: number[]): [middle: number, reach: number] {
  values.sort((a, b) => a - b);
  const [low, high] = [STRAYS, 1 - STRAYS].map((share) => values[Math.round(share * (values.length - 1))]!) as [number, number];
  return [(low + high) / 2, (high - low) / 2];
}
