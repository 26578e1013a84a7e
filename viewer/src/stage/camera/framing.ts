import * as THREE from 'three';
import type { StartCamera } from '../../bundle/manifest.ts';
import type { Sitter } from './sitter.ts';

/** The shape of the picture that is to be filled. */
export interface Picture {
  aspect: number; // width / height
  free: number; // share of the height, from above, that neither controls nor captions lie on
  clear?: number; // the same without captions, which may lie on legs; `free` where it is not known
  top?: number; // share of the height, from above, on which words lie so near that heads keep clear of them
}

/** Where the camera stands for a picture. */
export type Framing = (picture: Picture) => StartCamera;

/** How much of somebody a visitor sees, from the nearest to the farthest. */
export const VIEWS = ['face', 'half', 'whole'] as const;
export type View = (typeof VIEWS)[number];

/** What a picture of somebody's upper part shows. */
interface Shot {
  line: number; // of the height, from above, where the eyes are on a free picture
  height: number; // m
  width: number; // m, where that makes the picture higher
}

const ACROSS_A_TABLE: Shot = { line: 0.3, height: 0.62, width: 0.4 }; // head and chest
const WITH_HANDS: Shot = { line: 0.26, height: 0.73, width: 0.505 }; // down to where gestures are made, over the controls
const CLOSE: Shot = { line: 0.42, height: 0.32, width: 0.26 };
const FACE = 0.24; // m of width that are always seen
const ABOVE = 0.03; // m over the head
const GROUND = 0.06; // m under the feet
const MARGIN = 0.04; // of the height, over a whole figure
const ARMS = 0.9; // m of width of a whole figure
const CHIN = 0.15; // m down from the eyes to under the chin

/**
 * Frames head and chest, the eyes in the upper third, the face clear of all controls. Under somebody
 * of whom only the head was recorded, no empty space is shown.
 *
 * @param fov degrees, from top to bottom
 */
export function portrait(sitter: Sitter, fov: number): Framing {
  return upperPart(sitter, fov, ACROSS_A_TABLE);
}

/**
 * Frames somebody with a body from the head to hands that speak: they are raised before the chest.
 *
 * @param fov degrees, from top to bottom
 */
export function talking(sitter: Sitter, fov: number): Framing {
  return upperPart(sitter, fov, WITH_HANDS);
}

/**
 * Frames the face alone, clear of all controls.
 *
 * @param fov degrees, from top to bottom
 */
export function closeUp(sitter: Sitter, fov: number): Framing {
  return upperPart(sitter, fov, CLOSE);
}

function upperPart(sitter: Sitter, fov: number, shot: Shot): Framing {
  const slope = Math.tan(THREE.MathUtils.degToRad(fov) / 2);
  const { eyes, toward, up } = sitter;
  return (picture) => {
    const { tilt, distance } = composition(sitter, shot, slope, picture);
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
function composition(
  { crown, lowest }: Sitter,
  { line: wantedLine, height, width }: Shot,
  slope: number,
  { aspect, free, top = 0 }: Picture,
): { tilt: number; distance: number } {
  const above = crown + ABOVE;
  const high = Math.max(height, width / aspect); // m of the picture, from above, at her place
  const line = Math.min(Math.max(wantedLine, top && top + above / high), top + ((free - top) * above) / (above + CHIN));
  const tilt = (1 - 2 * line) * slope;
  // Angles between the ray to the eyes and those to the edges.
  const [edge, down] = [Math.atan(slope), Math.atan(tilt)];
  const [toTop, toBottom, toControls] = [Math.atan((1 - 2 * top) * slope) - down, edge + down, Math.atan((2 * free - 1) * slope) + down];
  const least = Math.max(
    above / Math.tan(toTop),
    CHIN / Math.tan(toControls),
    FACE / (2 * aspect * slope * Math.cos(down)),
  );
  const wanted = high / (2 * slope);
  const nothingUnder = toBottom < Math.PI / 2 ? lowest / Math.tan(toBottom) : 0;
  return { tilt, distance: Math.max(least, Math.min(wanted, nothingUnder)) };
}

/**
 * Frames somebody from crown to feet, level, between the upper edge and the controls. Captions come
 * and go over the legs: a gap for them would leave somebody small in the upper half of a phone.
 *
 * @param fov degrees, from top to bottom
 */
export function figure({ eyes, toward, up, crown, lowest }: Sitter, fov: number): Framing {
  const slope = Math.tan(THREE.MathUtils.degToRad(fov) / 2);
  const level = toward.clone().projectOnPlane(up).normalize();
  return ({ aspect, free, clear = free }) => {
    const length = crown + ABOVE + lowest + GROUND;
    const height = Math.max(length / (clear - MARGIN), ARMS / aspect);
    const room = clear * height - length; // over the head and under the feet
    const middle = crown + ABOVE + room / 2 - height / 2; // over the eyes
    const target = eyes.clone().addScaledVector(up, middle);
    const eye = target.clone().addScaledVector(level, height / (2 * slope));
    return { eye: eye.toArray(), target: target.toArray(), up: up.toArray(), fov_y: fov };
  };
}

/** The bundle's own camera, which sees everybody whole; the view widens where the sides would be cut off. */
export function whole(camera: StartCamera, narrowest: number): Framing {
  const slope = Math.tan(THREE.MathUtils.degToRad(camera.fov_y) / 2);
  return ({ aspect }) => {
    const fov = 2 * Math.atan(slope * Math.max(1, narrowest / aspect));
    return { ...camera, fov_y: THREE.MathUtils.radToDeg(fov) };
  };
}
