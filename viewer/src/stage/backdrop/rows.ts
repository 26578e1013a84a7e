import { copy } from '../../numbers.ts';
import { ROW_BYTES, type Source } from '../../soft/source.ts';

/** Numbers of a row of a source that stands still. */
export const NUMBERS = ROW_BYTES.still / 4;

const LEAST = 1e-9; // m, of a scale
const HARMONIC = 0.28209479177387814; // of degree 0
/** What splats of one size are told apart by. */
export const HASH = 2654435769;
/** More than there are splats: a size and a place make one whole number of 53 bits. */
const PLACES = 2 ** 20;
/** By which splats of one size differ, each by a share of its own: else all of them would go at once. */
export const APART = 1e-3;

/** A colour of its mean in spherical harmonics. */
export function colourOf(mean: number): number {
  return Math.max(0, 0.5 + HARMONIC * mean);
}

/** Opacity times the two larger scales, m². */
export function sizeOf(index: number, opacity: number, x: number, y: number, z: number): number {
  return ((opacity * x * y * z) / Math.max(LEAST, Math.min(x, y, z))) * (1 + (APART * (Math.imul(index, HASH) >>> 8)) / 2 ** 24);
}

/** A source of rows, the largest splats first. */
export function sourceOf(rows: Float32Array): Source {
  const count = rows.length / NUMBERS;
  const sizes = new Float32Array(count);
  for (let i = 0; i < count; i++) sizes[i] = sizeOf(i, rows[NUMBERS * i + 13]!, rows[NUMBERS * i + 7]!, rows[NUMBERS * i + 8]!, rows[NUMBERS * i + 9]!);
  const sorted = new Float32Array(rows.length);
  for (const [place, i] of falling(sizes).entries()) copy(rows, NUMBERS * i, NUMBERS, sorted, NUMBERS * place);
  return { kind: 'still', count, rows: sorted.buffer, sizes: [] };
}

/** The places of sizes (N,), the largest first; without a function that compares, which takes a second for a million. */
function falling(sizes: Float32Array): Uint32Array {
  const bits = new Uint32Array(sizes.buffer); // these rise as the sizes do, which are not negative
  const keys = Float64Array.from(bits, (size, i) => (2 ** 32 - size) * PLACES + i).sort();
  return Uint32Array.from(keys, (key) => key % PLACES);
}
