import * as THREE from 'three';
import { bodyOf, type Manifest } from '../bundle/manifest.ts';
import { boundsOf, boundsOfBody } from './bounds.ts';
import { closeUp, figure, portrait, whole } from './framing.ts';
import type { Subject } from './orbit.ts';
import type { Sitter } from './sitter.ts';

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
  const views = { face: closeUp(sitter, fov), half: portrait(sitter, fov) };
  return {
    up: camera.up,
    framings: bodyOf(manifest) ? { ...views, whole: figure(sitter, fov) } : views,
    home: 'half',
    bounds: (start) => boundsOf(sitter, start, camera),
    sideways: bodyOf(manifest) ? Infinity : FRONT,
    face: sitter.eyes,
  };
}
