import * as THREE from 'three';
import type { HeadFiles } from '../../bundle/load.ts';
import { bodyOf, type Manifest } from '../../bundle/manifest.ts';
import { eyesOf, sampled } from '../../head/eyes.ts';
import { Poses } from '../../head/poses.ts';

/** Somebody to take a picture of, world space, m. */
export interface Sitter {
  eyes: THREE.Vector3; // the point between them, in the middle of where the head usually is
  toward: THREE.Vector3; // from the eyes to the visitor, of length 1
  up: THREE.Vector3; // of the world, of length 1
  crown: number; // how far the head goes up from the eyes
  lowest: number; // how far down from the eyes there is something of the person
  box: THREE.Box3; // around all that is seen of the person
}

const SEEN = 0.3; // opacity from which a Gaussian counts
const STRAYS = 0.01; // share of a head's Gaussians, at either end, that may lie anywhere
const CROWNS = [0.09, 0.25] as const; // m: from a shaved head to the highest hair
const ASIDE = THREE.MathUtils.degToRad(-18); // to the right of somebody who turns the head: people hardly ever stand square to each other
const NECK = 0.09; // m from the axis about which a head turns to between the eyes
const LEVEL = 0.5; // of a direction's length: what is steeper does not say where somebody looks

/**
 * Who sits before the camera, from the bundle's own data.
 *
 * A head alone is seen from where it was recorded: only from there its look is known well. Somebody
 * with a body was recorded from all around and is met face to face, or a little aside if the face turns to the visitor.
 *
 * @param rows of the head's poses, where the head is at rest
 * @param turns whether the head turns to where the visitor is
 * @param local the point between the eyes in the head's own space
 */
export function sitterOf(
  manifest: Manifest,
  files: HeadFiles,
  rows: readonly number[],
  turns: boolean,
  local = new THREE.Vector3(...eyesOf(files.baked, files.info)),
): Sitter {
  const { camera } = manifest;
  const body = bodyOf(manifest);
  const up = new THREE.Vector3(...camera.up).normalize();
  const [eyes, forward] = faceOf(files, rows, local);
  const start = new THREE.Vector3(...camera.eye);
  const recorded = start.clone().sub(body ? new THREE.Vector3(...camera.target) : eyes).normalize();
  const toward = body ? (level(forward, up) ?? level(recorded, up) ?? recorded) : recorded;
  if (turns) {
    eyes.addScaledVector(toward, -NECK);
    eyes.addScaledVector(toward.applyAxisAngle(up, ASIDE), NECK);
  }
  const points = visiblePoints(files, rows[0]!);
  const heights = points.map((point) => point.clone().sub(eyes).dot(up)).sort((a, b) => a - b);
  const box = new THREE.Box3().setFromPoints(withoutStrays(points));
  if (body) box.expandByPoint(new THREE.Vector3(...body.low)).expandByPoint(new THREE.Vector3(...body.high));
  const lowest = body ? Math.max(...corners(box).map((corner) => eyes.clone().sub(corner).dot(up))) : -share(heights, STRAYS);
  return { eyes, toward, up, crown: THREE.MathUtils.clamp(share(heights, 1 - STRAYS), ...CROWNS), lowest, box };
}

/** The corners of a box. */
export function corners({ min, max }: THREE.Box3): THREE.Vector3[] {
  return [min.x, max.x].flatMap((x) => [min.y, max.y].flatMap((y) => [min.z, max.z].map((z) => new THREE.Vector3(x, y, z))));
}

/** Means over the poses: the point between the eyes, and where the face looks. */
function faceOf({ poses }: HeadFiles, rows: readonly number[], local: THREE.Vector3): [THREE.Vector3, THREE.Vector3] {
  const [eyes, forward] = [new THREE.Vector3(), new THREE.Vector3()];
  const [track, head] = [new Poses(poses), new THREE.Object3D()];
  for (const row of rows) {
    track.apply(row, head);
    head.updateMatrix();
    eyes.addScaledVector(local.clone().applyMatrix4(head.matrix), 1 / rows.length);
    forward.add(new THREE.Vector3(0, 0, 1).applyQuaternion(head.quaternion));
  }
  return [eyes, forward.normalize()];
}

/** Gaussians that are seen, in one of the head's poses. */
function visiblePoints({ baked, poses }: HeadFiles, row: number): THREE.Vector3[] {
  const head = new THREE.Object3D();
  new Poses(poses).apply(row, head);
  head.updateMatrix();
  const threshold = Math.log(SEEN / (1 - SEEN));
  const seen = sampled(baked.count, (i) => baked.meanLogits[4 * i + 3]! > threshold);
  const points = seen.length > 0 ? seen : sampled(baked.count, () => true);
  return points.map((i) => new THREE.Vector3().fromArray(baked.means, 3 * i).applyMatrix4(head.matrix));
}

function withoutStrays(points: readonly THREE.Vector3[]): THREE.Vector3[] {
  const limits = ([0, 1, 2] as const).map((axis) => {
    const values = points.map((point) => point.getComponent(axis)).sort((a, b) => a - b);
    return [share(values, STRAYS), share(values, 1 - STRAYS)] as const;
  });
  return [0, 1].map((end) => new THREE.Vector3(...(limits.map((limit) => limit[end]!) as [number, number, number])));
}

/** The value under which a share of sorted values lies. */
function share(sorted: readonly number[], fraction: number): number {
  return sorted[Math.round(fraction * (sorted.length - 1))]!;
}

/** A direction made horizontal; null if it hardly points anywhere then. */
function level(direction: THREE.Vector3, up: THREE.Vector3): THREE.Vector3 | null {
  const flat = direction.clone().projectOnPlane(up);
  return flat.length() > LEVEL ? flat.normalize() : null;
}
