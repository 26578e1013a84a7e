import * as THREE from 'three';
import type { StartCamera } from '../bundle/manifest.ts';
import type { Sitter } from './sitter.ts';

/** The shape of the picture that is to be filled. */
export interface Picture {
  aspect: number; // width / height
  free: number; // share of the height, from above, that no control lies on
}

/** Where the camera stands for a picture. */
export type Framing = (picture: Picture) => StartCamera;

const EYE_LINE = 0.3; // of the height, from above, where the eyes are on a free picture
const TABLE = 0.62; // m of height: head and chest, as one sees somebody across a table
const SHOULDERS = 0.4; // m of width
const FACE = 0.24; // m of width that are always seen
const ABOVE = 0.03; // m over the head
const CHIN = 0.15; // m down from the eyes to under the chin

/**
 * Frames head and chest, the eyes in the upper third, the face clear of all controls. Under somebody
 * of whom only the head was recorded, no empty space is shown.
 *
 * @param fov degrees, from top to bottom
 */
export function portrait(sitter: Sitter, fov: number): Framing {
  const slope = Math.tan(THREE.MathUtils.degToRad(fov) / 2);
  const { eyes, toward, up } = sitter;
  return (picture) => {
    const { tilt, distance } = composition(sitter, slope, picture);
    const eye = eyes.clone().addScaledVector(toward, distance);
    const upright = up.clone().projectOnPlane(toward).normalize();
    const target = eyes.clone().addScaledVector(upright, -tilt * distance);
    return { eye: eye.toArray(), target: target.toArray(), up: up.toArray(), fov_y: fov };
  };
}

/**
 * How far the camera looks under the eyes, as a slope, and how far from them it is, m.
 *
 * @param slope of the picture's upper edge against its middle
 */
function composition({ crown, lowest }: Sitter, slope: number, { aspect, free }: Picture): { tilt: number; distance: number } {
  const above = crown + ABOVE;
  const line = Math.min(EYE_LINE, (free * above) / (above + CHIN));
  const tilt = (1 - 2 * line) * slope;
  // Angles between the ray to the eyes and those to the edges.
  const [edge, down] = [Math.atan(slope), Math.atan(tilt)];
  const [toTop, toBottom, toControls] = [edge - down, edge + down, Math.atan((2 * free - 1) * slope) + down];
  const least = Math.max(
    above / Math.tan(toTop),
    CHIN / Math.tan(toControls),
    FACE / (2 * aspect * slope * Math.cos(down)),
  );
  const wanted = Math.max(TABLE, SHOULDERS / aspect) / (2 * slope);
  const nothingUnder = toBottom < Math.PI / 2 ? lowest / Math.tan(toBottom) : 0;
  return { tilt, distance: Math.max(least, Math.min(wanted, nothingUnder)) };
}

/** The bundle's own camera, which sees everybody whole; the view widens where the sides would be cut off. */
export function whole(camera: StartCamera, narrowest: number): Framing {
  const slope = Math.tan(THREE.MathUtils.degToRad(camera.fov_y) / 2);
  return ({ aspect }) => {
    const fov = 2 * Math.atan(slope * Math.max(1, narrowest / aspect));
    return { ...camera, fov_y: THREE.MathUtils.radToDeg(fov) };
  };
}
