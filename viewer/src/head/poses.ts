import * as THREE from 'three';

/** The captured head motion, played back and forth for ever. */
export class PoseLoop {
  private readonly positions: THREE.Vector3[] = [];
  private readonly rotations: THREE.Quaternion[] = [];
  private readonly fps: number;

  /** @param poses (F,4,4) row-major world_from_head */
  constructor(poses: Float32Array, fps: number) {
    this.fps = fps;
    for (let i = 0; i < poses.length; i += 16) {
      const position = new THREE.Vector3();
      const rotation = new THREE.Quaternion();
      new THREE.Matrix4().fromArray(poses, i).transpose().decompose(position, rotation, new THREE.Vector3());
      this.positions.push(position);
      this.rotations.push(rotation);
    }
  }

  /** Writes the pose at `seconds` to an object. */
  apply(seconds: number, object: THREE.Object3D): void {
    const { index, next, fraction } = backAndForth(seconds * this.fps, this.positions.length);
    object.position.lerpVectors(this.positions[index]!, this.positions[next]!, fraction);
    object.quaternion.slerpQuaternions(this.rotations[index]!, this.rotations[next]!, fraction);
  }
}

/** Where in a sequence of `length` rows a point that runs to the end and back is. */
export function backAndForth(row: number, length: number): { index: number; next: number; fraction: number } {
  const last = length - 1;
  if (last === 0) return { index: 0, next: 0, fraction: 0 };
  const phase = row % (2 * last);
  const at = phase > last ? 2 * last - phase : phase;
  const index = Math.min(Math.floor(at), last - 1);
  return { index, next: index + 1, fraction: at - index };
}
