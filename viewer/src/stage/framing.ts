import * as THREE from 'three';
import type { StartCamera } from '../bundle/manifest.ts';
import type { Sitter } from './sitter.ts';

/** What there is to fill. */
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
 * Head and chest, the eyes in the upper third, the face clear of all controls, nobody cut off where
 * there is more of them, and no empty space shown under those of whom only the head was recorded.
 *
 * @param fov degrees, from top to bottom
 */
export function portrait(sitter: Sitter, fov: number): Framing {
  const slope = Math.tan(THREE.MathUtils.degToRad(fov) / 2);
  const { eyes, toward, up } = sitter;
  return ({ aspect, free }) => {
    const { line, height } = composition(sitter, aspect, free);
    const distance = height / (2 * slope);
    const eye = eyes.clone().addScaledVector(toward, distance);
    const upright = up.clone().projectOnPlane(toward).normalize();
    const target = eyes.clone().addScaledVector(upright, (2 * line - 1) * slope * distance);
    return { eye: eye.toArray(), target: target.toArray(), up: up.toArray(), fov_y: fov };
  };
}

/** Where the eyes are, from above, and how many metres of the eyes' plane the picture is high. */
function composition({ crown, lowest }: Sitter, aspect: number, free: number): { line: number; height: number } {
  const above = crown + ABOVE;
  const line = Math.min(EYE_LINE, (free * above) / (above + CHIN));
  const least = Math.max(above / line, CHIN / (free - line), FACE / aspect);
  const wanted = Math.max(TABLE, SHOULDERS / aspect);
  return { line, height: Math.max(least, Math.min(wanted, lowest / (1 - line))) };
}

/** The bundle's own camera, which sees everybody whole; the view widens where the sides would be cut off. */
export function whole(camera: StartCamera, narrowest: number): Framing {
  const slope = Math.tan(THREE.MathUtils.degToRad(camera.fov_y) / 2);
  return ({ aspect }) => {
    const fov = 2 * Math.atan(slope * Math.max(1, narrowest / aspect));
    return { ...camera, fov_y: THREE.MathUtils.radToDeg(fov) };
  };
}
