import { bodyOf, type Manifest } from '../bundle/manifest.ts';

/** A square of a picture, in shares of its side. */
export interface Crop {
  left: number;
  top: number;
  side: number;
}

const SEEN = 0.5; // m of a person: head and shoulders
const ABOVE = 0.05; // m over the head
const LEAST = 0.2; // of the side: less has too few pixels

type Vector = readonly [number, number, number];

/**
 * Where a bundle's thumbnail, which its camera took, shows head and shoulders of somebody with a body;
 * null of a head alone, who fills it.
 */
export function headInThumbnail({ camera, ...manifest }: Pick<Manifest, 'camera' | 'head' | 'body' | 'skinned'>): Crop | null {
  const body = bodyOf(manifest);
  if (!manifest.head || !body) return null;
  const ahead = scaled(camera.target, camera.eye);
  const aside = scaled(cross(ahead, camera.up));
  const upward = cross(aside, ahead);
  const middle = body.low.map((low, axis) => (low + body.high[axis]!) / 2) as unknown as Vector;
  const reach = body.low.reduce((sum, low, axis) => sum + (Math.abs(camera.up[axis]!) * (body.high[axis]! - low)) / 2, 0);
  const way = middle.map((value, axis) => value + camera.up[axis]! * reach - camera.eye[axis]!) as unknown as Vector; // to the crown
  const width = 2 * Math.tan((camera.fov_y * Math.PI) / 360) * dot(way, ahead); // m that the picture shows there
  const side = Math.min(1, Math.max(LEAST, SEEN / width));
  const within = (value: number) => Math.min(1 - side, Math.max(0, value));
  return {
    left: within(0.5 + dot(way, aside) / width - side / 2),
    top: within(0.5 - (dot(way, upward) + ABOVE) / width),
    side,
  };
}

function dot(a: Vector, b: Vector): number {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

function cross(a: Vector, b: Vector): Vector {
  return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}

/** The direction from a point, by default the origin, of length 1. */
function scaled(to: Vector, from: Vector = [0, 0, 0]): Vector {
  const way: Vector = [to[0] - from[0], to[1] - from[1], to[2] - from[2]];
  const length = Math.sqrt(dot(way, way));
  return [way[0] / length, way[1] / length, way[2] / length];
}
