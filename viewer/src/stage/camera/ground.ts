import { Vector3 } from 'three';

/** Where somebody stands, world space. */
export interface Ground {
  foot: Vector3; // on the floor, under the middle of the body
  up: Vector3; // of the world, of length 1
  toward: Vector3; // where the person faces, level, of length 1
}

/** An ellipse on the floor, along the side and the front of who stands there. */
export interface Patch {
  middle: Vector3; // on the floor
  size: [aside: number, ahead: number]; // m from the middle to where a shadow has faded to a third
}

/** The shadow of somebody's feet. */
export interface Footprint extends Patch {
  soles: Patch[]; // where each foot touches the floor, or nearly; none of a foot in the air
}

const LOW = 0.15; // m over the floor: feet, and what trails
const TOUCHING = 0.05; // m over the floor: soles, with a shoe's sides
const STRAYS = 0.05; // share of the points, at either end, that may lie anywhere
const BLUR = 0.2; // m by which the shadow fades beyond the feet
const EDGE = 0.06; // m by which it fades beyond a sole

/**
 * Where a shadow lies under somebody.
 *
 * @param points (N,3) of the person in the world, m
 * @returns null where nothing of the person is near the floor
 */
export function footprintOf(points: Float32Array, ground: Ground): Footprint | null {
  const { foot, up, toward } = ground;
  const side = new Vector3().crossVectors(up, toward);
  const low: [aside: number, ahead: number, height: number][] = [];
  const point = new Vector3();
  for (let at = 0; at < points.length; at += 3) {
    point.fromArray(points, at).sub(foot);
    const height = point.dot(up);
    if (height <= LOW) low.push([point.dot(side), point.dot(toward), height]);
  }
  if (low.length === 0) return null;
  const spread = (under: readonly (typeof low)[number][], blur: number): Patch => {
    const [[x, width], [z, depth]] = [extent(under.map(([aside]) => aside)), extent(under.map(([, ahead]) => ahead))];
    const middle = foot.clone().addScaledVector(side, x).addScaledVector(toward, z);
    return { middle, size: [Math.hypot(width, blur), Math.hypot(depth, blur)] };
  };
  const whole = spread(low, BLUR);
  const between = whole.middle.clone().sub(foot).dot(side);
  const touching = low.filter(([, , height]) => height <= TOUCHING);
  const feet = [touching.filter(([aside]) => aside <= between), touching.filter(([aside]) => aside > between)];
  return { ...whole, soles: feet.filter((under) => under.length > 0).map((under) => spread(under, EDGE)) };
}

/** Middle of values, and how far they reach from it. */
function extent(values: number[]): [middle: number, reach: number] {
  values.sort((a, b) => a - b);
  const [low, high] = [STRAYS, 1 - STRAYS].map((share) => values[Math.round(share * (values.length - 1))]!) as [number, number];
  return [(low + high) / 2, (high - low) / 2];
}
