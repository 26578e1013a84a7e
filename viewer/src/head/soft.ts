import type { HeadRows } from '../bundle/baked-head.ts';
import { copy } from '../numbers.ts';
import { PackedParts } from '../soft/parts.ts';
import { makeRows, ROW_BYTES, type Late, type SoftObject, type Source } from '../soft/source.ts';

/** Gaussians of a head, and how much each moves with the shoulders, of 255. */
export interface ShownRows extends HeadRows {
  share: Uint8Array; // (N,)
}

/** A head as it is now. */
export interface HeadNow {
  readonly parts: readonly ShownRows[];
  readonly values: Float32Array; // (K,) coefficients, (M,) steps, (7,) motion of the shoulders
  readonly grown: number; // share of what came after the first part that is seen
  readonly wide: number; // by which sizes of the first part are multiplied
}

/** A head for the processor's path. */
export class SoftHead implements SoftObject {
  private readonly head: HeadNow;
  private readonly packed: PackedParts<ShownRows>;

  constructor(head: HeadNow) {
    this.head = head;
    this.packed = new PackedParts(head.parts, pack);
  }

  get source(): Source {
    return this.packed.source;
  }

  get drawn(): number {
    return this.packed.drawn(this.head.grown);
  }

  get late(): Late {
    return this.packed.late(this.head.grown, this.head.wide);
  }

  get values(): Float32Array {
    return this.head.values;
  }
}

function pack({ count, rank, moves, means, quats, scales, basisScale, meanLogits, basis, displacements, share }: ShownRows): Source {
  const stride = ROW_BYTES.head + 4 * (rank + moves);
  const { rows, floats } = makeRows(count, stride);
  const bytes = new Int8Array(rows);
  for (let i = 0; i < count; i++) {
    const at = (i * stride) / 4;
    copy(means, 3 * i, 3, floats, at);
    copy(quats, 4 * i, 4, floats, at + 3);
    for (let k = 0; k < 3; k++) floats[at + 7 + k] = Math.exp(scales[3 * i + k]!);
    floats[at + 10] = basisScale[i]!;
    copy(meanLogits, 4 * i, 4, floats, at + 11);
    floats[at + 15] = share[i]! / 255;
    const vectors = i * stride + ROW_BYTES.head;
    for (let k = 0; k < rank; k++) copy(basis, 4 * (count * k + i), 4, bytes, vectors + 4 * k);
    for (let m = 0; m < moves; m++) copy(displacements, 3 * (count * m + i), 3, bytes, vectors + 4 * (rank + m));
  }
  return { kind: 'head', count, rows, sizes: [rank, moves] };
}
