import { Quaternion, Vector3 } from 'three';
import type { ShouldersFile } from '../bundle/load.ts';
import { Poses } from './poses.ts';

/** No motion; motions are a rotation wxyz with w ≥ 0, and a shift in metres. */
export const STILL = [1, 0, 0, 0, 0, 0, 0];

export const MOTION_SIZE = STILL.length;

/** The shoulders of a head alone, which do not turn with it. */
export class Shoulders {
  private readonly poses: Poses;
  private readonly moved = new Float32Array(MOTION_SIZE);
  private readonly place = { position: new Vector3(), quaternion: new Quaternion() };

  constructor({ poses }: ShouldersFile) {
    this.poses = new Poses(poses);
  }

  /** How they have moved against a head that is at a row of its poses; valid until the next call. */
  motion(row: number, head: { position: Vector3; quaternion: Quaternion }): Float32Array {
    this.poses.apply(row, this.place);
    const back = head.quaternion.clone().invert();
    const { x, y, z } = this.place.position.sub(head.position).applyQuaternion(back);
    const turn = back.multiply(this.place.quaternion);
    const way = turn.w < 0 ? -1 : 1;
    this.moved.set([way * turn.w, way * turn.x, way * turn.y, way * turn.z, x, y, z]);
    return this.moved;
  }
}
