import * as THREE from 'three';
import type { StartCamera } from '../../bundle/manifest.ts';

const DURATION = 0.9; // s
const SAME = 0.02; // of a distance: less is no coming nearer

/**
 * The way of a camera from one view to another: around what it looks at, in a straight line where it
 * only comes nearer, starting and ending at rest.
 */
export class Flight {
  private readonly from: StartCamera;
  private readonly to: StartCamera;
  private readonly start: THREE.Spherical;
  private readonly end: THREE.Spherical;

  /** @param to has the same up as `from` */
  constructor(from: StartCamera, to: StartCamera) {
    this.from = from;
    this.to = to;
    this.start = directionOf(from);
    this.end = directionOf(to);
    // The shorter way around.
    const turn = this.end.theta - this.start.theta;
    this.end.theta = this.start.theta + turn - 2 * Math.PI * Math.round(turn / (2 * Math.PI));
  }

  /** Where the camera is after some seconds. */
  at(seconds: number): StartCamera {
    const { from, to, start, end } = this;
    if (this.isOver(seconds)) return to;
    const part = THREE.MathUtils.smootherstep(seconds, 0, DURATION);
    const nearer = end.radius / start.radius;
    const radius = start.radius * nearer ** part;
    // Targets move as distances do: so a point that both views show does not swing aside.
    const way = Math.abs(nearer - 1) < SAME ? part : (radius - start.radius) / (end.radius - start.radius);
    const mix = (a: number, b: number, share: number) => a + share * (b - a);
    const target = new THREE.Vector3(...from.target).lerp(new THREE.Vector3(...to.target), way);
    const offset = new THREE.Spherical(radius, mix(start.phi, end.phi, part), mix(start.theta, end.theta, part));
    const eye = new THREE.Vector3().setFromSpherical(offset).applyQuaternion(upright(to.up).invert()).add(target);
    return { eye: eye.toArray(), target: target.toArray(), up: to.up, fov_y: mix(from.fov_y, to.fov_y, part) };
  }

  isOver(seconds: number): boolean {
    return seconds >= DURATION;
  }
}

/** From the target to the eye, with the world's up as the pole. */
export function directionOf({ eye, target, up }: StartCamera): THREE.Spherical {
  const offset = new THREE.Vector3(...eye).sub(new THREE.Vector3(...target));
  return new THREE.Spherical().setFromVector3(offset.applyQuaternion(upright(up)));
}

/** Turns an up direction to y. */
function upright(up: readonly [number, number, number]): THREE.Quaternion {
  return new THREE.Quaternion().setFromUnitVectors(new THREE.Vector3(...up).normalize(), new THREE.Vector3(0, 1, 0));
}
