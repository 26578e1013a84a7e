import { ROW_BYTES, type Source } from '../../soft/source.ts';

/** Numbers of a row of a source that stands still. */
export const NUMBERS = ROW_BYTES.still / 4;

const LEAST = 1e-9; // m, of a scale
const HARMONIC = 0.28209479177387814; // of degree 0
/** What splats of one size are told apart by. */
export const HASH = 2654435769;
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
  const row = (i: number) => rows.subarray(NUMBERS * i, NUMBERS * (i + 1));
  const sizes = Float32Array.from({ length: count }, (_, i) => sizeOf(i, row(i)[13]!, row(i)[7]!, row(i)[8]!, row(i)[9]!));
  const order = Uint32Array.from(sizes.keys()).sort((a, b) => sizes[b]! - sizes[a]!);
  const sorted = new Float32Array(rows.length);
  for (const [place, i] of order.entries()) sorted.set(row(i), NUMBERS * place);
  return { kind: 'still', count, rows: sorted.buffer, sizes: [] };
}
