import * as THREE from 'three';
import { bodyOf, type Manifest } from '../../bundle/manifest.ts';
import { boundsOf, boundsOfBody } from './bounds.ts';
import { closeUp, figure, portrait, talking, whole } from './framing.ts';
import type { Subject } from './orbit.ts';
import type { Ground } from './ground.ts';
import { corners, type Sitter } from './sitter.ts';

const FRONT = THREE.MathUtils.degToRad(75); // to either side: heads are recorded from the front
const NARROWEST = 0.45; // width / height that still holds a whole body

/** What the camera sees while nobody is on stage yet, and of a body whose head is nowhere told. */
export function wholeBody(manifest: Manifest): Subject {
  const { camera } = manifest;
  const body = bodyOf(manifest);
  const [low, high] = [body?.low ?? camera.target, body?.high ?? camera.target].map((corner) => new THREE.Vector3(...corner));
  const box = new THREE.Box3(low, high);
  return {
    up: camera.up,
    framings: { whole: whole(camera, NARROWEST) },
    home: 'whole',
    bounds: () => boundsOfBody(box, camera),
    sideways: Infinity,
    face: null,
  };
}

/** Somebody with a face. */
export function person(manifest: Manifest, sitter: Sitter): Subject {
  const { camera } = manifest;
  const fov = camera.fov_y;
  const face = closeUp(sitter, fov);
  const body = { half: talking(sitter, fov), whole: figure(sitter, fov) };
  return {
    up: camera.up,
    framings: bodyOf(manifest) ? { face, ...body } : { face, half: portrait(sitter, fov) },
    home: 'half',
    bounds: (start) => boundsOf(sitter, start, camera),
    sideways: bodyOf(manifest) ? Infinity : FRONT,
    face: sitter.eyes,
  };
}

/** Where somebody with a face and a body stands. */
export function groundUnder({ eyes, toward, up, lowest, box }: Sitter): Ground {
  const level = toward.clone().projectOnPlane(up).normalize();
  const floor = eyes.dot(up) - lowest;
  const middle = box.getCenter(new THREE.Vector3()).projectOnPlane(up); // arms reach out, heads lean: between both
  const foot = eyes.clone().projectOnPlane(up).lerp(middle, 0.5).addScaledVector(up, floor);
  return { foot, up, toward: level };
}

/** Where a body whose head is nowhere told stands, and how high it is in m; null if there is no body. */
export function groundOf(manifest: Manifest): { ground: Ground; height: number } | null {
  const body = bodyOf(manifest);
  if (!body) return null;
  const { camera } = manifest;
  const up = new THREE.Vector3(...camera.up).normalize();
  const box = new THREE.Box3(new THREE.Vector3(...body.low), new THREE.Vector3(...body.high));
  const heights = corners(box).map((corner) => corner.dot(up));
  const floor = Math.min(...heights);
  const foot = box.getCenter(new THREE.Vector3()).projectOnPlane(up).addScaledVector(up, floor);
  const toward = new THREE.Vector3(...camera.eye).sub(foot).projectOnPlane(up).normalize();
  return { ground: { foot, up, toward }, height: Math.max(...heights) - floor };
}
