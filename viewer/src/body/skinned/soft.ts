import { copy } from '../../numbers.ts';
import { SHADOW } from '../../shared.ts';
import { PackedParts } from '../../soft/parts.ts';
import { makeRows, ROW_BYTES, type Late, type SoftObject, type Source } from '../../soft/source.ts';
import type { BakedSkinned, SkinnedRows } from './baked.ts';
import type { ShadowMap } from './shadow.ts';

const MILLIMETRE = 1e-3;
const LAMP = 4 * 8; // where it begins among the values, behind the light
const RESIDUAL = LAMP + 4 * 5;
const TABLE = RESIDUAL + 8;

/** A body on a skeleton as it is now. */
export interface SkinnedNow {
  readonly version: number; // another one whenever it looks otherwise
  readonly baked: BakedSkinned;
  readonly parts: readonly SkinnedRows[];
  readonly table: Float32Array; // (J,TABLE_ROW) joints
  readonly residual: Float64Array; // (K,) coefficients of the shapes
  readonly map: ShadowMap | null;
  readonly most: number; // Gaussians that are drawn
  readonly grown: number; // share of what came after the first part that is seen
  readonly wide: number; // by which sizes of the first part are multiplied
}

/** A body on a skeleton for the processor's path. */
export class SoftSkinned implements SoftObject {
  private readonly body: SkinnedNow;
  private readonly packed: PackedParts<SkinnedRows>;
  private readonly written: Float32Array;
  private version = -1; // of the body, whose values were written

  constructor(body: SkinnedNow) {
    const { baked: { info, light, lamp }, map, table } = body;
    this.body = body;
    this.packed = new PackedParts(body.parts, (rows) => pack(rows, info, map ? SHADOW.side : 0));
    this.written = new Float32Array(TABLE + table.length + (map?.depths.length ?? 0));
    for (let k = 0; k < 8; k++) this.written.set(light.subarray(3 * k, 3 * k + 3), 4 * k);
    if (!lamp || !map) return;
    for (let k = 0; k < 3; k++) this.written.set(map.axes.subarray(3 * k, 3 * k + 3), LAMP + 4 * k);
    this.written.set([...lamp.strength, SHADOW.texel, SHADOW.bias, SHADOW.off, SHADOW.wrap, SHADOW.edge], LAMP + 12);
  }

  get source(): Source {
    return this.packed.source;
  }

  get drawn(): number {
    return Math.min(this.body.most, this.packed.drawn(this.body.grown));
  }

  get late(): Late {
    return this.packed.late(this.body.grown, this.body.wide);
  }

  get values(): Float32Array {
    const { version, table, residual, map } = this.body;
    if (version !== this.version) {
      this.version = version;
      this.written.set(residual, RESIDUAL);
      this.written.set(table, TABLE);
      if (map) this.written.set(map.depths, TABLE + table.length);
    }
    return this.written;
  }
}

function pack(baked: SkinnedRows, { num_shapes: shapes, names }: BakedSkinned['info'], side: number): Source {
  const { count } = baked;
  const stride = ROW_BYTES.skinned + 8 * shapes;
  const { rows, floats } = makeRows(count, stride);
  const bytes = new Uint8Array(rows);
  for (let i = 0; i < count; i++) {
    const at = (i * stride) / 4;
    copy(baked.means, 3 * i, 3, floats, at);
    for (let k = 0; k < 4; k++) floats[at + 3 + k] = baked.quats[4 * i + k]! / 32767;
    for (let k = 0; k < 3; k++) floats[at + 7 + k] = Math.exp(baked.logScales[3 * i + k]!);
    copy(baked.colorLogits, 3 * i, 3, floats, at + 10);
    floats[at + 13] = baked.opacities[i]! / 255;
    copy(baked.normals, 3 * i, 3, floats, at + 15);
    floats[at + 19] = MILLIMETRE * baked.shapeScales[2 * i]!;
    floats[at + 20] = baked.shapeScales[2 * i + 1]!;
    copy(baked.joints, 4 * i, 4, bytes, i * stride + 84);
    copy(baked.weights, 4 * i, 4, bytes, i * stride + 88);
    for (let k = 0; k < shapes; k++) {
      const from = 6 * (shapes * i + k);
      const to = i * stride + ROW_BYTES.skinned + 8 * k;
      copy(baked.shapes, from, 3, bytes, to);
      copy(baked.shapes, from + 3, 3, bytes, to + 4);
    }
  }
  return { kind: 'skinned', count, rows, sizes: [shapes, names.length, side] };
}
