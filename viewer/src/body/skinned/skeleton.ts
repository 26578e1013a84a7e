import type { SkinnedInfo } from '../../bundle/manifest.ts';
import { quatAt, slerp, upper, type Quat, type Vector } from '../../rig/quaternions.ts';
import { Rig } from '../../rig/rig.ts';
import type { RecordedPoses } from './baked.ts';

/** How a body stands. */
export interface Pose {
  rotations: Float64Array; // (J,4) wxyz of each joint about itself, 1 long
  root: Float64Array; // (3,) metres that the root moves from rest
  residual: Float64Array; // (K,) coefficients of the residual shapes
}

/** Numbers of a joint in a table: the rows of the matrix (R | t), the quaternion wxyz. */
export const TABLE_ROW = 16;

/** Of the distance to the nearest known pose, by which the kernel of any other pose is wider. */
const FARTHER = 0.5;

/** Forward kinematics of a rig, its recorded poses, and what any other pose has of the residual shapes. */
export class Skeleton {
  readonly rig: Rig;
  private readonly info: SkinnedInfo;
  private readonly poses: RecordedPoses;
  private readonly held: Float64Array; // (J,4)
  private readonly known: Float64Array; // (P,3·M) features

  constructor(info: SkinnedInfo, poses: RecordedPoses) {
    this.info = info;
    this.poses = poses;
    const { joints, held, known, rotations } = poses;
    const rest = info.parents.map((_, j): Vector => [joints[3 * j]!, joints[3 * j + 1]!, joints[3 * j + 2]!]);
    this.rig = new Rig(info.parents, rest);
    this.held = Float64Array.from(info.names.flatMap((_, j) => quatAt(held, j)));
    const moving = info.num_moving;
    this.known = new Float64Array(3 * moving * info.num_known);
    for (let p = 0; p < info.num_known; p++) {
      for (let m = 0; m < moving; m++) {
        this.known.set(feature(quatAt(rotations, known[p]! * moving + m)), 3 * (p * moving + m));
      }
    }
  }

  /** A pose to write into: the rest pose. */
  empty(): Pose {
    const { names, num_shapes: shapes } = this.info;
    const rotations = Float64Array.from({ length: 4 * names.length }, (_, i) => (i % 4 === 0 ? 1 : 0));
    return { rotations, root: new Float64Array(3), residual: new Float64Array(shapes) };
  }

  /** Writes the recorded pose at a frame; between two, joints turn on the shorter arc and all else goes straight. */
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

  /** Writes the coefficients of a pose that need not have been recorded: a mean of those of poses like it. */
  interpolate(pose: Pose): void {
    const { num_moving: moving, num_shapes: shapes, num_known: count } = this.info;
    const { kernelWidth, coefficients, known } = this.poses;
    const here = new Float64Array(3 * moving);
    this.poses.moving.forEach((joint, m) => here.set(feature(quatAt(pose.rotations, joint)), 3 * m));
    const away = Float64Array.from({ length: count }, (_, p) =>
      here.reduce((sum, value, i) => sum + (this.known[3 * moving * p + i]! - value) ** 2, 0),
    );
    const nearest = away.reduce((least, value) => Math.min(least, value), Infinity);
    const square = kernelWidth ** 2 + FARTHER ** 2 * (nearest + this.awayFromHeld(pose));
    const parts = away.map((value) => Math.exp((nearest - value) / (2 * square)));
    const total = parts.reduce((sum, value) => sum + value, 0);
    pose.residual.fill(0);
    parts.forEach((part, p) => {
      for (let k = 0; k < shapes; k++) pose.residual[k]! += (part / total) * coefficients[known[p]! * shapes + k]!;
    });
  }

  /** The square of how far the joints that the recording never turns are from how they are held. */
  private awayFromHeld({ rotations }: Pose): number {
    let sum = 0;
    for (const j of this.info.names.keys()) {
      if (this.poses.moving.includes(j)) continue;
      const [held, here] = [this.held, rotations].map((all) => feature(quatAt(all, j)));
      for (const i of here!.keys()) sum += (held![i]! - here![i]!) ** 2;
    }
    return sum;
  }

  /** Writes what takes each joint's points from rest to the world: (J, TABLE_ROW). */
  table(pose: Pose, out: Float32Array): void {
    // Each with w ≥ 0, so that the signs of a joint and its parent agree.
    const rotations = this.info.parents.map((_, j) => upper(quatAt(pose.rotations, j)));
    const posed = this.rig.posed(rotations, [pose.root[0]!, pose.root[1]!, pose.root[2]!]);
    const matrices = this.rig.matrices(posed);
    posed.turned.forEach((quat, j) => {
      out.set(matrices.subarray(12 * j, 12 * j + 12), TABLE_ROW * j);
      out.set(quat, TABLE_ROW * j + 12);
    });
  }
}

/** What poses are compared by, of one joint. */
function feature(quat: Quat): Vector {
  const [, x, y, z] = upper(quat);
  return [x, y, z];
}

/** Writes what lies between two rows. */
function mix(rows: Float32Array, size: number, first: number, part: number, out: Float64Array): void {
  for (let i = 0; i < size; i++) out[i] = (1 - part) * rows[first * size + i]! + part * rows[(first + 1) * size + i]!;
}
