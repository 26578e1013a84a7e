import { SHADOW } from '../../shared.ts';
import { joined, makeRows, ROW_BYTES, type SoftObject, type Source } from '../../soft/source.ts';
import type { BakedSkinned, SkinnedRows } from './baked.ts';
import type { ShadowMap } from './shadow.ts';
import { TABLE_ROW } from './skeleton.ts';

const MILLIMETRE = 1e-3;
const LAMP = 4 * 8; // where it begins among the values, behind the light
const RESIDUAL = LAMP + 4 * 5;
const TABLE = RESIDUAL + 8;

/** A body on a skeleton for the processor's path. */
export class SoftSkinned implements SoftObject {
  /** Gaussians that are drawn at most. */
  limit = Infinity;
  readonly values: Float32Array;
  private readonly info: BakedSkinned['info'];
  private readonly parts: SkinnedRows[];
  private shown: number; // Gaussians that came and may be seen
  private readonly map: ShadowMap | null;
  private packed: Source | null = null;

  /** @param map what the lamp sees */
  constructor(baked: BakedSkinned, map: ShadowMap | null) {
    const { info, light, lamp } = baked;
    this.info = info;
    this.parts = [baked];
    this.map = map;
    this.shown = baked.count;
    const behind = TABLE + TABLE_ROW * info.names.length;
    this.values = new Float32Array(behind + (map?.depths.length ?? 0));
    for (let k = 0; k < 8; k++) this.values.set(light.subarray(3 * k, 3 * k + 3), 4 * k);
    if (!lamp || !map) return;
    for (let k = 0; k < 3; k++) this.values.set(map.axes.subarray(3 * k, 3 * k + 3), LAMP + 4 * k);
    this.values.set([...lamp.strength, SHADOW.texel, SHADOW.bias, SHADOW.off, SHADOW.wrap, SHADOW.edge], LAMP + 12);
  }

  get source(): Source {
    const side = this.map ? SHADOW.side : 0;
    return (this.packed ??= joined(this.parts.map((rows) => pack(rows, this.info, side))));
  }

  get drawn(): number {
    return Math.min(this.limit, this.shown);
  }

  /** Takes the Gaussians that come after the first ones; they are not seen until `show`. */
  complete(rest: SkinnedRows): void {
    this.parts.push(rest);
    this.packed = null;
  }

  /** Draws what came later, too. */
  show(): void {
    this.shown = this.parts.reduce((sum, { count }) => sum + count, 0);
  }

  /** Takes a pose: the table of joints (J,TABLE_ROW) and the coefficients of the shapes; the shadow map is drawn. */
  pose(table: Float32Array, residual: Float64Array): void {
    this.values.set(residual, RESIDUAL);
    this.values.set(table, TABLE);
    if (this.map) this.values.set(this.map.depths, TABLE + table.length);
  }
}

function pack(baked: SkinnedRows, { num_shapes: shapes, names }: BakedSkinned['info'], side: number): Source {
  const { count } = baked;
  const stride = ROW_BYTES.skinned + 8 * shapes;
  const { rows, floats } = makeRows(count, stride);
  const bytes = new Uint8Array(rows);
  for (let i = 0; i < count; i++) {
    const at = (i * stride) / 4;
    floats.set(baked.means.subarray(3 * i, 3 * i + 3), at);
    for (let k = 0; k < 4; k++) floats[at + 3 + k] = baked.quats[4 * i + k]! / 32767;
    for (let k = 0; k < 3; k++) floats[at + 7 + k] = Math.exp(baked.logScales[3 * i + k]!);
    floats.set(baked.colorLogits.subarray(3 * i, 3 * i + 3), at + 10);
    floats[at + 13] = baked.opacities[i]! / 255;
    floats.set(baked.normals.subarray(3 * i, 3 * i + 3), at + 15);
    floats[at + 19] = MILLIMETRE * baked.shapeScales[2 * i]!;
    floats[at + 20] = baked.shapeScales[2 * i + 1]!;
    bytes.set(baked.joints.subarray(4 * i, 4 * i + 4), i * stride + 84);
    bytes.set(baked.weights.subarray(4 * i, 4 * i + 4), i * stride + 88);
    for (let k = 0; k < shapes; k++) {
      const from = 6 * (shapes * i + k);
      const to = i * stride + ROW_BYTES.skinned + 8 * k;
      bytes.set(new Uint8Array(baked.shapes.buffer, baked.shapes.byteOffset + from, 3), to);
      bytes.set(new Uint8Array(baked.shapes.buffer, baked.shapes.byteOffset + from + 3, 3), to + 4);
    }
  }
  return { kind: 'skinned', count, rows, sizes: [shapes, names.length, side] };
}
