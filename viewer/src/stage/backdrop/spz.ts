import { colourOf, NUMBERS } from './rows.ts';
import { HEADER, isPacked, unpack } from './unpacking.ts';

const COLOUR_SCALE = 0.15;
const SMALL = Math.SQRT1_2 / 511; // step of a quaternion's smaller components: 9 bits for up to √½

/**
 * Reads an SPZ file of version 2 or 3: a gzip stream of one table after the other.
 *
 * @returns rows as `readSplats` gives them; null if it is of another kind
 * @throws PageError if it is damaged
 */
export async function readSpz(bytes: ArrayBuffer, name: string): Promise<Float32Array | null> {
  if (!isPacked(bytes)) return null;
  const data = new DataView((await unpack(bytes, name)).buffer);
  const [version, count] = [data.getUint32(4, true), data.getUint32(8, true)];
  const step = 2 ** -data.getUint8(13); // m
  const [alphas, colours, scales, rotations] = [9, 10, 13, 16].map((before) => HEADER + before * count) as [number, number, number, number];
  const rows = new Float32Array(NUMBERS * count);
  for (let i = 0; i < count; i++) {
    const at = NUMBERS * i;
    for (let k = 0; k < 3; k++) {
      const place = HEADER + 9 * i + 3 * k;
      rows[at + k] = step * (data.getUint16(place, true) | (data.getInt8(place + 2) << 16));
      rows[at + 7 + k] = Math.exp(data.getUint8(scales + 3 * i + k) / 16 - 10);
      rows[at + 10 + k] = colourOf((data.getUint8(colours + 3 * i + k) / 255 - 0.5) / COLOUR_SCALE);
    }
    rows[at + 13] = data.getUint8(alphas + i) / 255;
    const turn = version === 2 ? vectorTurn(data, rotations + 3 * i) : packedTurn(data.getUint32(rotations + 4 * i, true));
    // By half around x: y and z change their signs, of places and of axes.
    rows[at + 1] = -rows[at + 1]!;
    rows[at + 2] = -rows[at + 2]!;
    rows.set([turn[3]!, turn[0]!, -turn[1]!, -turn[2]!], at + 3);
  }
  return rows;
}

/** A rotation xyzw of three bytes; w is what is missing, and positive. */
function vectorTurn(data: DataView, at: number): number[] {
  const vector = [0, 1, 2].map((k) => data.getUint8(at + k) / 127.5 - 1);
  return [...vector, missing(vector)];
}

/** A rotation xyzw of a word: which component is the largest, and the three others. */
function packedTurn(word: number): number[] {
  const largest = word >>> 30;
  const turn = [0, 0, 0, 0];
  for (let k = 3; k >= 0; k--) {
    if (k === largest) continue;
    turn[k] = (word & 511) * SMALL * (word & 512 ? -1 : 1);
    word >>>= 10;
  }
  turn[largest] = missing(turn);
  return turn;
}

function missing(others: readonly number[]): number {
  return Math.sqrt(Math.max(0, 1 - others.reduce((sum, value) => sum + value * value, 0)));
}
