import type { SkinnedInfo } from '../../bundle/manifest.ts';
import { quatAt, slerp, upper, type Quat, type Vector } from '../../rig/quaternions.ts';
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

/** Share of the distance to the nearest known pose that is added, in squares, to the kernel's width. */
const FARTHER = 0.5;

/** Forward kinematics of a rig, its recorded poses, and coefficients of the residual shapes in any pose. */
export class Skeleton {
  readonly rig: Rig;
  private readonly info: SkinnedInfo;
  private readonly poses: RecordedPoses;
  private readonly held: Float64Array; // (J,4) local rotations of joints that do not turn in the recording
  private readonly known: Float64Array; // (P,3·M) features of the known poses

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

  /** Writes the coefficients of any pose: a mean of those of the known poses, weighted by a Gaussian kernel. */
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

  /** Squared distance of features of the joints that do not turn in the recording from how they are held there. */
  private awayFromHeld({ rotations }: Pose): number {
    let sum = 0;
    for (const j of this.info.names.keys()) {
      if (this.poses.moving.includes(j)) continue;
      const [held, here] = [this.held, rotations].map((all) => feature(quatAt(all, j)));
      for (const i of here!.keys()) sum += (held![i]! - here![i]!) ** 2;
    }
    return sum;
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

/** Where joints at rest are moved by a table of `Skeleton`: (J,3) positions, m. */
export function placesOf(rest: readonly Vector[], table: Float32Array): Float32Array {
  return Float32Array.from({ length: 3 * rest.length }, (_, i) => {
    const [joint, axis] = [Math.floor(i / 3), i % 3];
    const [x, y, z] = rest[joint]!;
    const row = TABLE_ROW * joint + 4 * axis;
    return table[row]! * x + table[row + 1]! * y + table[row + 2]! * z + table[row + 3]!;
  });
}

/** Features of a joint's rotation by which poses are compared: sin(angle / 2) times the axis. */
function feature(quat: Quat): Vector {
  const [, x, y, z] = upper(quat);
  return [x, y, z];
}

/** Writes the linear interpolation between row `first` (part 0) and the next one (part 1). */
function mix(rows: Float32Array, size: number, first: number, part: number, out: Float64Array): void {
  for (let i = 0; i < size; i++) out[i] = (1 - part) * rows[first * size + i]! + part * rows[(first + 1) * size + i]!;
}
