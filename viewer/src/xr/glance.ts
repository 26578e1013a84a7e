import * as THREE from 'three';
import { directionTo, Gaze } from '../gesture/performing/gaze.ts';
import type { RigidMotion } from '../head/head.ts';
import type { Meeting } from '../stage/camera/meeting.ts';

const NECK = 0.1; // m under the eyes: what a head turns about

/** A head without a body turns to the visitor, as far and as fast as heads on bodies do. */
export class Glance {
  private readonly gaze = new Gaze();
  private readonly facing = new THREE.Matrix4(); // from a space where the head faces +z, with y up
  private readonly pivot: THREE.Vector3;
  private seconds = 0;

  constructor({ ground: { up, toward }, eyes }: Meeting) {
    this.facing.makeBasis(up.clone().cross(toward), up, toward);
    this.pivot = eyes.clone().addScaledVector(up, -NECK);
  }

  /** Looks at somebody's eyes, m in the world, `step` seconds later. */
  look(visitor: THREE.Vector3, step: number): void {
    const { x, y, z } = visitor.clone().sub(this.pivot).applyMatrix4(this.facing.clone().transpose());
    this.gaze.look(...directionTo([0, NECK, 0], [x, y, z]));
    this.seconds += step;
  }

  /** How far the head has turned from where it would be. */
  motion(): RigidMotion {
    const turns = this.gaze.at(this.seconds).map(([w, x, y, z]) => new THREE.Quaternion(x, y, z, w)); // chest, neck, head
    const facing = new THREE.Quaternion().setFromRotationMatrix(this.facing);
    const turn = turns.reduce((sum, one) => sum.multiply(one), facing.clone()).multiply(facing.invert());
    const shift = this.pivot.clone().sub(this.pivot.clone().applyQuaternion(turn));
    return [[turn.w, turn.x, turn.y, turn.z], shift.toArray()];
  }
}
