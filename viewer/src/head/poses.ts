import * as THREE from 'three';

/** The captured poses of a head. */
export class Poses {
  private readonly positions: THREE.Vector3[] = [];
  private readonly rotations: THREE.Quaternion[] = [];

  /** @param poses (F,4,4) row-major world_from_head */
  constructor(poses: Float32Array) {
    for (let i = 0; i < poses.length; i += 16) {
      const position = new THREE.Vector3();
      const rotation = new THREE.Quaternion();
      new THREE.Matrix4().fromArray(poses, i).transpose().decompose(position, rotation, new THREE.Vector3());
      this.positions.push(position);
      this.rotations.push(rotation);
    }
  }

  get count(): number {
    return this.positions.length;
  }

  /** Writes the pose at a row, between two or held at the ends, to an object. */
  apply(row: number, object: { position: THREE.Vector3; quaternion: THREE.Quaternion }): void {
    const last = this.count - 1;
    const at = Math.min(Math.max(row, 0), last);
    const index = Math.floor(at);
    const next = Math.min(index + 1, last);
    const fraction = at - index;
    object.position.lerpVectors(this.positions[index]!, this.positions[next]!, fraction);
    object.quaternion.slerpQuaternions(this.rotations[index]!, this.rotations[next]!, fraction);
  }
}

/** Where in a sequence of `length` rows a point that runs to the end and back is. */
export function backAndForth(row: number, length: number): number {
  const last = length - 1;
  if (last === 0) return 0;
  const phase = row % (2 * last);
  return phase > last ? 2 * last - phase : phase;
}
