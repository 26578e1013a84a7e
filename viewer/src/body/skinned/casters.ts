import { SHADOW } from '../../shared.ts';
import type { BakedLamp } from './baked.ts';
import encoded from './kernel/index.ts?wasm-bytes';
import { TABLE_ROW } from './skeleton.ts';

const { radius: RADIUS, texel: TEXEL, side: SIDE, off: OFF, bias: BIAS, edge: EDGE } = SHADOW;
const POINT = 1e-4; // metres
const SHORTEST = 1e-12; // of a squared length

/** The kernel that draws spheres in WebAssembly (`kernel/index.ts`, which says what each function does). */
interface Kernel {
  readonly memory: WebAssembly.Memory;
  reserve(bytes: number): number;
  prepare(side: number, texel: number, radius: number, bias: number, edge: number, out: number): number;
  draw(axes: number, centres: number, count: number): void;
  gather(axes: number, centres: number, normals: number, count: number, open: number, whole: number): void;
}

/** The spheres under the skin as they are in a pose, in the memory of a kernel that draws them. */
export class Casters {
  readonly centres: Float64Array; // (M,3) metres
  readonly normals: Float64Array; // (M,3) out of the body, 1 long; empty where there are none
  /** Light that was gathered on the skin above the spheres, (M,), and what it would be without the others. */
  readonly open: Float64Array;
  readonly whole: Float64Array;
  private readonly lamp: BakedLamp;
  private readonly kernel: Kernel;
  private readonly axes: Float64Array; // (3,3) by which was drawn last
  private readonly map: number; // address
  private readonly table: Float32Array; // of the pose
  private readonly rows = new Float64Array(12); // of one sphere

  /** @param joints number of the skeleton's */
  constructor(lamp: BakedLamp, joints: number) {
    const count = lamp.points.length / 3;
    const facing = lamp.normals ? count : 0;
    this.lamp = lamp;
    this.kernel = makeKernel();
    this.map = this.kernel.prepare(SIDE, TEXEL, RADIUS, BIAS, EDGE, RADIUS + OFF);
    // All room is made before it is looked at: memory that grows is another buffer.
    const sizes = [9, 3 * count, 3 * facing, facing, facing];
    const places = sizes.map((size) => [this.kernel.reserve(8 * size), size] as const);
    const views = places.map(([at, size]) => new Float64Array(this.kernel.memory.buffer, at, size));
    [this.axes, this.centres, this.normals, this.open, this.whole] = views as [Float64Array, Float64Array, Float64Array, Float64Array, Float64Array];
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

  /** Draws the spheres as a lamp sees them, by axes (3,3): across, up and towards it. */
  draw(axes: Float64Array): void {
    this.axes.set(axes);
    this.kernel.draw(this.axes.byteOffset, this.centres.byteOffset, this.centres.length / 3);
  }

  /** Writes how far towards the lamp the nearest sphere reached at each texel, (SIDE,SIDE) metres. */
  depths(out: Float32Array): void {
    const padded = new Float32Array(this.kernel.memory.buffer, this.map, (SIDE + 4) * SIDE);
    for (let row = 0; row < SIDE; row++) out.set(padded.subarray((SIDE + 4) * row, (SIDE + 4) * row + SIDE), SIDE * row);
  }

  /** Adds the light of the lamp by which was drawn to `open`, and what it would be without other spheres to `whole`. */
  gather(): void {
    const { axes, centres, normals, open, whole } = this;
    this.kernel.gather(axes.byteOffset, centres.byteOffset, normals.byteOffset, open.length, open.byteOffset, whole.byteOffset);
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

/** A kernel with memory of its own; it is so small that browsers compile it at once. */
function makeKernel(): Kernel {
  const bytes = Uint8Array.from(atob(encoded), (letter) => letter.charCodeAt(0));
  return new WebAssembly.Instance(new WebAssembly.Module(bytes), { env: { abort: () => {} } }).exports as unknown as Kernel;
}
