import * as THREE from 'three';
import type { StartCamera } from '../../bundle/manifest.ts';
import { corners, type Sitter } from './sitter.ts';

/** What keeps a camera from ending inside somebody, or where there is nobody to see. */
export interface Bounds {
  nearest: number; // m from the target
  farthest: number;
  spine: THREE.Line3; // some of it stays in the picture
  eyes: THREE.Vector3 | null; // the face around them does, clear of the controls
  solids: THREE.Plane[][]; // convex, their planes look outward: no camera inside
  head: THREE.Sphere | null; // none here either
}

const FACE_FILLS = 0.18; // m of height: closer nobody gets
const LEAST = 0.3; // m between the camera and a face
const HEAD_BEHIND = 0.08; // m from the eyes back to the middle of a head
const UNDER_FACE = 0.13; // m from the eyes down to where the body begins
const CLEAR = 0.1; // m around a body
const ASIDE = 0.25; // m from the spine that may be looked at from nearby: arms
const FACE = { aside: 0.08, above: 0.04, below: 0.12 }; // m from the eyes
const NEAR = { aside: 0.5, above: 0.4, below: 0.6 }; // of half of the picture, at most: from nearby the eyes alone
const SPINE = 0.9; // of half of the picture, aside of which the spine may be
const HALVINGS = 16;
const FARTHER = 1.8; // than where the visitor starts

/**
 * @param start where the visitor begins
 * @param overview from where all of the person is seen
 */
export function boundsOf(sitter: Sitter, start: StartCamera, overview: StartCamera): Bounds {
  const { eyes, toward, up, box, lowest } = sitter;
  const slope = Math.tan(THREE.MathUtils.degToRad(start.fov_y) / 2);
  const nearest = Math.max(LEAST, FACE_FILLS / (2 * slope));
  const neck = new THREE.Plane().setFromNormalAndCoplanarPoint(up, eyes.clone().addScaledVector(up, -UNDER_FACE));
  return {
    nearest,
    farthest: FARTHER * Math.max(distance(start), distance(overview)),
    spine: new THREE.Line3(eyes.clone().addScaledVector(up, -lowest), eyes.clone()),
    eyes,
    solids: [[...sides(box, CLEAR), neck]],
    head: new THREE.Sphere(eyes.clone().addScaledVector(toward, -HEAD_BEHIND), nearest + HEAD_BEHIND - 1e-3),
  };
}

/** Of a body of which nobody knows where its head is. */
export function boundsOfBody(box: THREE.Box3, camera: StartCamera): Bounds {
  const up = new THREE.Vector3(...camera.up).normalize();
  const middle = box.getCenter(new THREE.Vector3());
  const reach = Math.max(...corners(box).map((corner) => corner.sub(middle).dot(up)));
  const spine = new THREE.Line3(middle.clone().addScaledVector(up, -reach), middle.clone().addScaledVector(up, reach));
  return { nearest: LEAST, farthest: FARTHER * distance(camera), spine, eyes: null, solids: [sides(box, CLEAR)], head: null };
}

/** What of a camera decides on what it sees. */
export interface Lens {
  slope: number; // half of the picture's height at 1 m
  aspect: number; // width / height
  free: number; // share of the height, from above, that nothing lies on
  up: THREE.Vector3; // of the world
}

/**
 * Moves a camera and what it looks at back to where it may be: aside until somebody's face is in the
 * picture, or some of a body that has none, then backwards until it is outside. It looks the same
 * way as before.
 */
export function confine(eye: THREE.Vector3, target: THREE.Vector3, bounds: Bounds, lens: Lens): void {
  const back = eye.clone().sub(target);
  const nearest = bounds.spine.closestPointToPoint(target, true, new THREE.Vector3());
  const aside = target.clone().sub(nearest);
  const half = lens.slope * Math.min(1, lens.aspect) * back.length();
  const shift = Math.min(0, Math.min(ASIDE + half / 2, SPINE * half) - aside.length());
  target.addScaledVector(aside.normalize(), shift);
  eye.copy(target).add(back);
  back.normalize();
  const way = bounds.eyes ? towardFace(eye, back, bounds.eyes, lens) : new THREE.Vector3();
  for (const point of [eye, target]) point.add(way);
  for (const solid of bounds.solids) eye.addScaledVector(back, wayOut(eye, back, solid));
  if (bounds.head) eye.addScaledVector(back, wayOutOfSphere(eye, back, bounds.head));
  for (const solid of bounds.solids) eye.addScaledVector(back, wayOut(eye, back, solid));
}

/** The way, across the line of sight, after which a camera sees the whole face, or as much of it as the picture holds. */
function towardFace(eye: THREE.Vector3, back: THREE.Vector3, eyes: THREE.Vector3, { slope, aspect, free, up }: Lens): THREE.Vector3 {
  const right = up.clone().cross(back).normalize();
  const upward = back.clone().cross(right);
  const way = eyes.clone().sub(eye);
  const half = slope * Math.max(0, -way.dot(back));
  const room = (side: keyof typeof FACE, length: number) => Math.min(FACE[side], NEAR[side] * length);
  const wide = half * aspect - room('aside', half * aspect);
  const [low, high] = [half * (1 - 2 * free) + room('below', half), half - room('above', half)];
  const [x, y] = [way.dot(right), way.dot(upward)];
  const [shownX, shownY] = [THREE.MathUtils.clamp(x, -wide, wide), THREE.MathUtils.clamp(y, Math.min(low, high), high)];
  return right.multiplyScalar(x - shownX).addScaledVector(upward, y - shownY);
}

/**
 * A scale as near to the wanted one as nobody is in the way of the camera; at scale 1 it is free.
 * Only pushed back, it would slide aside.
 */
export function freeScale(wanted: number, eyeAt: (scale: number) => THREE.Vector3, bounds: Bounds): number {
  if (!isInside(eyeAt(wanted), bounds)) return wanted;
  let [free, taken] = [1, wanted];
  for (let i = 0; i < HALVINGS; i++) {
    const between = (free + taken) / 2;
    if (isInside(eyeAt(between), bounds)) taken = between;
    else free = between;
  }
  return free;
}

function isInside(eye: THREE.Vector3, { solids, head }: Bounds): boolean {
  const inSolid = solids.some((solid) => solid.every((plane) => plane.distanceToPoint(eye) < 0));
  return inSolid || (head !== null && head.distanceToPoint(eye) < 0);
}

/** How far it is along a direction until a point is outside; 0 if it is. */
function wayOut(point: THREE.Vector3, direction: THREE.Vector3, solid: readonly THREE.Plane[]): number {
  const depths = solid.map((plane) => -plane.distanceToPoint(point));
  if (depths.some((depth) => depth <= 0)) return 0;
  const ways = solid.map(({ normal }, i) => depths[i]! / Math.max(normal.dot(direction), 1e-9));
  return Math.min(...ways);
}

function wayOutOfSphere(point: THREE.Vector3, direction: THREE.Vector3, sphere: THREE.Sphere): number {
  const from = point.clone().sub(sphere.center);
  const along = from.dot(direction);
  const inside = sphere.radius ** 2 - from.lengthSq();
  return inside > 0 ? Math.sqrt(along ** 2 + inside) - along : 0;
}

function sides(box: THREE.Box3, clearance: number): THREE.Plane[] {
  const { min, max } = box.clone().expandByScalar(clearance);
  return ([0, 1, 2] as const).flatMap((axis) => {
    const normal = new THREE.Vector3().setComponent(axis, 1);
    return [new THREE.Plane(normal, -max.getComponent(axis)), new THREE.Plane(normal.clone().negate(), min.getComponent(axis))];
  });
}

function distance({ eye, target }: StartCamera): number {
  return new THREE.Vector3(...eye).distanceTo(new THREE.Vector3(...target));
}
