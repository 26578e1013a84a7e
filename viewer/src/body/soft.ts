import { copy } from '../numbers.ts';
import { makeRows, ROW_BYTES, type SoftObject, type Source } from '../soft/source.ts';
import { coefficientTexels, type Capacity, type PackedWindow } from './packed.ts';

/** A slot as it is now. */
export interface SlotNow {
  readonly content: PackedWindow | null;
  readonly capacity: Capacity;
  readonly coefficients: Float32Array;
  readonly count: number; // Gaussians that take part in pictures
  readonly unseen: boolean;
}

/** A slot for the processor's path. */
export class SoftSlot implements SoftObject {
  private readonly slot: SlotNow;
  private packed: { content: PackedWindow; source: Source } | null = null;

  constructor(slot: SlotNow) {
    this.slot = slot;
  }

  get source(): Source | null {
    const { content, capacity } = this.slot;
    if (content && this.packed?.content !== content) this.packed = { content, source: softWindow(content, capacity) };
    return content && this.packed!.source;
  }

  get drawn(): number {
    return this.slot.unseen ? 0 : this.slot.count;
  }

  get values(): Float32Array {
    return this.slot.coefficients;
  }
}

/** A window in a slot for the processor's path. */
function softWindow({ window, rest, colours, basis }: PackedWindow, { width, rows: texelRows, ranks }: Capacity): Source {
  const count = window.num_gaussians;
  const layer = 4 * width * texelRows;
  const vectors = ranks[0] + ranks[1] + ranks[2];
  const stride = ROW_BYTES.window + 8 * vectors;
  const { rows, floats, bytes } = makeRows(count, stride);
  const shorts = new Int16Array(rows);
  for (let i = 0; i < count; i++) {
    const [at, texel] = [(i * stride) / 4, 4 * i];
    copy(rest, texel, 3, floats, at);
    for (let k = 0; k < 4; k++) floats[at + 3 + k] = basis[texel + k]! / 32767;
    copy(rest, layer + texel, 3, floats, at + 7);
    for (let k = 0; k < 4; k++) floats[at + 10 + k] = colours[texel + k]! / 255;
    bytes.setUint32(i * stride + 56, rest[texel + 3]!, true);
    for (let k = 0; k < vectors; k++) {
      copy(basis, (1 + k) * layer + texel, 4, shorts, (i * stride + ROW_BYTES.window) / 2 + 4 * k);
    }
  }
  return { kind: 'window', count, rows, sizes: [...ranks, 4 * coefficientTexels(ranks)] };
}
