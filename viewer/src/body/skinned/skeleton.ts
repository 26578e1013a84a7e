import type { SkinnedInfo } from '../../bundle/manifest.ts';
import type { RecordedPoses } from './baked.ts';
import { multiply, normalize, slerp, toMatrix } from './quaternions.ts';

/** How a body stands. */
export interface Pose {
  rotations: Float64Array; // (J,4) wxyz of each joint about itself, 1 long
  root: Float64Array; // (3,) metres that the root moves from rest
  residual: Float64Array; // (K,) coefficients of the residual shapes
}

/** Numbers of a joint in a table: the rows of the matrix (R | t), the quaternion wxyz. */
export const TABLE_ROW = 16;

/** Forward kinematics of a rig, its recorded poses, and what any other pose has of the residual shapes. */
export class Skeleton {
  private readonly info: SkinnedInfo;
  private readonly poses: RecordedPoses;
  private readonly held: Float64Array; // (J,4)
  private readonly known: Float64Array; // (P,3·M) features
  private readonly ends: Float64Array; // of an interval of the recording: (2,M,4)
  private readonly local: Float64Array; // (J,4) w ≥ 0
  private readonly turned: Float64Array; // (J,4) from rest space to the world
  private readonly places: Float64Array; // (J,3)
  private readonly matrix = new Float64Array(9);

  constructor(info: SkinnedInfo, poses: RecordedPoses) {
    this.info = info;
    this.poses = poses;
    const joints = info.names.length;
    const moving = info.num_moving;
    this.held = new Float64Array(4 * joints);
    for (let j = 0; j < joints; j++) normalize(poses.held, 4 * j, this.held, 4 * j);
    this.known = new Float64Array(3 * moving * info.num_known);
    const one = new Float64Array(4);
    for (let p = 0; p < info.num_known; p++) {
      for (let m = 0; m < moving; m++) {
        normalize(poses.rotations, 4 * (poses.known[p]! * moving + m), one, 0, true);
        this.known.set(one.subarray(1), 3 * (p * moving + m));
      }
    }
    this.ends = new Float64Array(8 * moving);
    this.local = new Float64Array(4 * joints);
    this.turned = new Float64Array(4 * joints);
    this.places = new Float64Array(3 * joints);
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
    for (let m = 0; m < 2 * moving; m++) normalize(rotations, 4 * (first * moving + m), this.ends, 4 * m);
    this.poses.moving.forEach((joint, m) => slerp(this.ends, 4 * m, 4 * (m + moving), part, out.rotations, 4 * joint));
    mix(roots, 3, first, part, out.root);
    mix(coefficients, shapes, first, part, out.residual);
  }

  /** Writes the coefficients of a pose that need not have been recorded: a mean of those of poses like it. */
  interpolate(pose: Pose): void {
    const { num_moving: moving, num_shapes: shapes, num_known: count } = this.info;
    const { kernelWidth, coefficients, known } = this.poses;
    const here = new Float64Array(4 * moving);
    this.poses.moving.forEach((joint, m) => normalize(pose.rotations, 4 * joint, here, 4 * m, true));
    const away = Float64Array.from({ length: count }, (_, p) => {
      let sum = 0;
      for (let i = 0; i < 3 * moving; i++) {
        const m = Math.floor(i / 3);
        sum += (this.known[3 * moving * p + i]! - here[4 * m + 1 + (i - 3 * m)]!) ** 2;
      }
      return sum / (2 * kernelWidth * kernelWidth);
    });
    const nearest = away.reduce((least, value) => Math.min(least, value), Infinity);
    const parts = away.map((value) => Math.exp(nearest - value));
    const total = parts.reduce((sum, value) => sum + value, 0);
    pose.residual.fill(0);
    parts.forEach((part, p) => {
      for (let k = 0; k < shapes; k++) pose.residual[k]! += (part / total) * coefficients[known[p]! * shapes + k]!;
    });
  }

  /** Writes what takes each joint's points from rest to the world: (J, TABLE_ROW). */
  table(pose: Pose, out: Float32Array): void {
    const { local, turned, places, matrix, poses: { joints } } = this;
    this.info.parents.forEach((parent, j) => {
      normalize(pose.rotations, 4 * j, local, 4 * j, true); // so signs agree with the parents'
      if (parent < 0) {
        turned.set(local.subarray(0, 4));
        for (let i = 0; i < 3; i++) places[i] = joints[i]! + pose.root[i]!;
      } else {
        multiply(turned, 4 * parent, local, 4 * j, turned, 4 * j);
        toMatrix(turned, 4 * parent, matrix);
        for (let i = 0; i < 3; i++) {
          let place = places[3 * parent + i]!;
          for (let c = 0; c < 3; c++) place += matrix[3 * i + c]! * (joints[3 * j + c]! - joints[3 * parent + c]!);
          places[3 * j + i] = place;
        }
      }
      toMatrix(turned, 4 * j, matrix);
      const row = TABLE_ROW * j;
      for (let i = 0; i < 3; i++) {
        let shift = places[3 * j + i]!;
        for (let c = 0; c < 3; c++) {
          out[row + 4 * i + c] = matrix[3 * i + c]!;
          shift -= matrix[3 * i + c]! * joints[3 * j + c]!;
        }
        out[row + 4 * i + 3] = shift;
      }
      out.set(turned.subarray(4 * j, 4 * j + 4), row + 12);
    });
  }
}

/** Writes what lies between two rows. */
function mix(rows: Float32Array, size: number, first: number, part: number, out: Float64Array): void {
  for (let i = 0; i < size; i++) out[i] = (1 - part) * rows[first * size + i]! + part * rows[(first + 1) * size + i]!;
}
