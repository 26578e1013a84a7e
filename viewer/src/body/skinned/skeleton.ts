import type { SkinnedInfo } from '../../bundle/manifest.ts';
import { PoseRegression } from '../../rig/pose-regression.ts';
import { quatAt, slerp, upper, type Vector } from '../../rig/quaternions.ts';
import { Rig } from '../../rig/rig.ts';
import type { RecordedPoses } from './baked.ts';

/** A pose of the skeleton, with coefficients of the residual shapes. */
export interface Pose {
  rotations: Float64Array; // (J,4) local rotation of each joint, unit quaternions wxyz
  root: Float64Array; // (3,) translation of the root from rest, metres
  residual: Float64Array; // (K,) coefficients of the residual shapes
}

/** Numbers in a joint's row of a table: the three rows of the matrix (R | t), then the quaternion wxyz of R. */
export const TABLE_ROW = 16;

/** Forward kinematics of a rig, its recorded poses, and coefficients of the residual shapes in any pose. */
export class Skeleton {
  readonly rig: Rig;
  private readonly info: SkinnedInfo;
  private readonly poses: RecordedPoses;
  private readonly held: Float64Array; // (J,4) local rotations of joints that do not turn in the recording
  private readonly residual: PoseRegression; // coefficients of the residual shapes

  constructor(info: SkinnedInfo, poses: RecordedPoses) {
    this.info = info;
    this.poses = poses;
    const { joints, held, known } = poses;
    const rest = info.parents.map((_, j): Vector => [joints[3 * j]!, joints[3 * j + 1]!, joints[3 * j + 2]!]);
    this.rig = new Rig(info.parents, rest);
    this.held = Float64Array.from(info.names.flatMap((_, j) => quatAt(held, j)));
    const rotations = new Float64Array(this.held.length * known.length);
    const values = new Float64Array(info.num_shapes * known.length);
    const pose = this.empty();
    known.forEach((frame, p) => {
      this.recorded(frame, pose);
      rotations.set(pose.rotations, p * pose.rotations.length);
      values.set(pose.residual, p * pose.residual.length);
    });
    this.residual = new PoseRegression({ count: known.length, rotations, values, width: poses.kernelWidth });
  }

  /** A new pose to write into, which is the rest pose. */
  empty(): Pose {
    const { names, num_shapes: shapes } = this.info;
    const rotations = Float64Array.from({ length: 4 * names.length }, (_, i) => (i % 4 === 0 ? 1 : 0));
    return { rotations, root: new Float64Array(3), residual: new Float64Array(shapes) };
  }

  /** Writes the recorded pose at a frame; between two frames by slerp of rotations, all else linearly. */
  recorded(frame: number, out: Pose): void {
    const { num_frames: frames, num_moving: moving, num_shapes: shapes } = this.info;
    const { rotations, roots, coefficients } = this.poses;
    const place = Math.min(Math.max(frame, 0), frames - 1);
    const first = Math.min(Math.floor(place), frames - 2);
    const part = place - first;
    out.rotations.set(this.held);
    this.poses.moving.forEach((joint, m) => {
      const [from, to] = [quatAt(rotations, first * moving + m), quatAt(rotations, (first + 1) * moving + m)];
      out.rotations.set(slerp(from, to, part), 4 * joint);
    });
    mix(roots, 3, first, part, out.root);
    mix(coefficients, shapes, first, part, out.residual);
  }

  /** Writes the coefficients of any pose, found from those of the known poses. */
  interpolate(pose: Pose): void {
    this.residual.at(pose.rotations, pose.residual);
  }

  /** Writes the rigid transforms of the joints from rest to the world: (J, TABLE_ROW). */
  table(pose: Pose, out: Float32Array): void {
    // All quaternions get w ≥ 0, so that the signs of products of joints and their parents agree.
    const rotations = this.info.parents.map((_, j) => upper(quatAt(pose.rotations, j)));
    const posed = this.rig.posed(rotations, [pose.root[0]!, pose.root[1]!, pose.root[2]!]);
    const matrices = this.rig.matrices(posed);
    posed.turned.forEach((quat, j) => {
      out.set(matrices.subarray(12 * j, 12 * j + 12), TABLE_ROW * j);
      out.set(quat, TABLE_ROW * j + 12);
    });
  }
}

/** Where points at rest (P,3) are moved by a table of `Skeleton`, each by the joint that carries it: (P,3) positions, m. */
export function placesOf(rest: readonly Vector[], carriers: readonly number[], table: Float32Array): Float32Array {
  return Float32Array.from({ length: 3 * rest.length }, (_, i) => {
    const [point, axis] = [Math.floor(i / 3), i % 3];
    const [x, y, z] = rest[point]!;
    const row = TABLE_ROW * carriers[point]! + 4 * axis;
    return table[row]! * x + table[row + 1]! * y + table[row + 2]! * z + table[row + 3]!;
  });
}

/** Writes the linear interpolation between row `first` (part 0) and the next one (part 1). */
function mix(rows: Float32Array, size: number, first: number, part: number, out: Float64Array): void {
  for (let i = 0; i < size; i++) out[i] = (1 - part) * rows[first * size + i]! + part * rows[(first + 1) * size + i]!;
}
