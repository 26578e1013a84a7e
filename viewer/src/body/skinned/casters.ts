import type { BakedLamp } from './baked.ts';
import { TABLE_ROW } from './skeleton.ts';

const POINT = 1e-4; // metres
const SHORTEST = 1e-12; // of a squared length

/** The spheres under the skin, and the directions out of the body at them, as they are in a pose. */
export class Casters {
  readonly centres: Float64Array; // (M,3) metres
  readonly normals: Float64Array; // (M,3) 1 long; empty where there are none
  private readonly lamp: BakedLamp;
  private readonly table: Float32Array; // of the pose
  private readonly rows = new Float64Array(12); // of one sphere

  /** @param joints number of the skeleton's */
  constructor(lamp: BakedLamp, joints: number) {
    this.lamp = lamp;
    this.centres = new Float64Array(lamp.points.length);
    this.normals = new Float64Array(lamp.normals?.length ?? 0);
    this.table = new Float32Array(TABLE_ROW * joints).fill(NaN);
  }

  /**
   * Takes a pose, whose joint table (J,TABLE_ROW) is given.
   *
   * @returns whether it is another one than before
   */
  pose(table: Float32Array): boolean {
    if (this.table.every((value, i) => value === table[i])) return false;
    this.table.set(table);
    const { centres, normals, rows, lamp: { points, normals: outward } } = this;
    for (let i = 0; i < centres.length; i += 3) {
      this.blend(i / 3);
      turn(rows, points, i, POINT, centres);
      for (let r = 0; r < 3; r++) centres[i + r]! += rows[4 * r + 3]!;
      if (!outward) continue;
      turn(rows, outward, i, 1, normals);
      const [x, y, z] = [normals[i]!, normals[i + 1]!, normals[i + 2]!];
      const long = 1 / Math.sqrt(Math.max(x * x + y * y + z * z, SHORTEST));
      for (let r = 0; r < 3; r++) normals[i + r]! *= long;
    }
    return true;
  }

  /** Writes the matrix (R | t) that moves a sphere. */
  private blend(sphere: number): void {
    const { rows, table, lamp: { joints, weights } } = this;
    rows.fill(0);
    for (let k = 4 * sphere, end = k + 4; k < end; k++) {
      const weight = weights[k]! / 255;
      if (weight === 0) continue;
      for (let c = 0, at = TABLE_ROW * joints[k]!; c < 12; c++) rows[c]! += weight * table[at + c]!;
    }
  }
}

/** Turns one of some vectors, in so large units, by a matrix (R | t). */
function turn(rows: Float64Array, from: Int16Array | Int8Array, at: number, unit: number, to: Float64Array): void {
  const x = unit * from[at]!;
  const y = unit * from[at + 1]!;
  const z = unit * from[at + 2]!;
  for (let r = 0; r < 3; r++) to[at + r] = rows[4 * r]! * x + rows[4 * r + 1]! * y + rows[4 * r + 2]! * z;
}
