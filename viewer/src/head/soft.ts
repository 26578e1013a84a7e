import type { HeadRows } from '../bundle/baked-head.ts';
import { joined, makeRows, ROW_BYTES, type SoftObject, type Source } from '../soft/source.ts';

/** A head for the processor's path. */
export class SoftHead implements SoftObject {
  drawn: number;
  readonly values: Float32Array;
  private readonly parts: HeadRows[];
  private packed: Source | null = null;

  /** @param values coefficients (K,) of the expression that is shown */
  constructor(head: HeadRows, values: Float32Array) {
    this.parts = [head];
    this.drawn = head.count;
    this.values = values;
  }

  get source(): Source {
    return (this.packed ??= joined(this.parts.map(pack)));
  }

  /** Takes the Gaussians that come after the first ones; they are not seen until `show`. */
  complete(rest: HeadRows): void {
    this.parts.push(rest);
    this.packed = null;
  }

  /** Draws what came later, too. */
  show(): void {
    this.drawn = this.parts.reduce((sum, { count }) => sum + count, 0);
  }
}

function pack({ count, rank, means, quats, scales, basisScale, meanLogits, basis }: HeadRows): Source {
  const stride = ROW_BYTES.head + 4 * rank;
  const { rows, floats } = makeRows(count, stride);
  const bytes = new Int8Array(rows);
  for (let i = 0; i < count; i++) {
    const at = (i * stride) / 4;
    floats.set(means.subarray(3 * i, 3 * i + 3), at);
    floats.set(quats.subarray(4 * i, 4 * i + 4), at + 3);
    for (let k = 0; k < 3; k++) floats[at + 7 + k] = Math.exp(scales[3 * i + k]!);
    floats[at + 10] = basisScale[i]!;
    floats.set(meanLogits.subarray(4 * i, 4 * i + 4), at + 11);
    for (let k = 0; k < rank; k++) {
      const from = 4 * (count * k + i);
      bytes.set(basis.subarray(from, from + 4), i * stride + ROW_BYTES.head + 4 * k);
    }
  }
  return { kind: 'head', count, rows, sizes: [rank] };
}
