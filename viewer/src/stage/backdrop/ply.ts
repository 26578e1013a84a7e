import { MAX_GAUSSIANS } from '../../shared.ts';
import { colourOf, NUMBERS } from './rows.ts';
import { isAllowed, unreadable } from './unpacking.ts';

const MOST_HEADER = 1 << 16; // bytes
const COUNT = /^[0-9]{1,30}$/;
const WIDTHS: Record<string, number> = {
  ...{ char: 1, int8: 1, uchar: 1, uint8: 1, short: 2, int16: 2, ushort: 2, uint16: 2 },
  ...{ int: 4, int32: 4, uint: 4, uint32: 4, float: 4, float32: 4, double: 8, float64: 8 },
};
const READ = ['x', 'y', 'z', 'rot_0', 'rot_1', 'rot_2', 'rot_3', 'scale_0', 'scale_1', 'scale_2', 'f_dc_0', 'f_dc_1', 'f_dc_2', 'opacity'];

/**
 * Reads a PLY file as the first 3D Gaussian Splatting wrote them: a table of floats, scales as
 * logarithms, opacities as logits, colours as harmonics.
 *
 * @returns rows as `readSplats` gives them; null if it is of another kind
 */
export function readPly(bytes: ArrayBuffer): Float32Array | null {
  const header = headerOf(bytes);
  if (!header) return null;
  const [format, table, ...properties] = header.lines;
  const named = properties.map(([word, type, name]) => (word === 'property' && (type === 'float' || type === 'float32') ? name : null));
  const columns = READ.map((name) => named.indexOf(name));
  const isKnown = format?.[1] === 'binary_little_endian' && table?.[0] === 'element' && table[1] === 'vertex';
  if (!isKnown || named.includes(null) || columns.includes(-1)) return null;
  const [count, stride] = [Number(table[2]), 4 * properties.length];
  if (!(count <= MAX_GAUSSIANS) || bytes.byteLength !== header.length + count * stride) return null;
  const data = new DataView(bytes, header.length);
  const rows = new Float32Array(NUMBERS * count);
  for (let i = 0; i < count; i++) {
    const at = NUMBERS * i;
    for (const [k, column] of columns.entries()) rows[at + k] = data.getFloat32(stride * i + 4 * column, true);
    for (let k = 7; k < 10; k++) rows[at + k] = Math.exp(rows[at + k]!);
    for (let k = 10; k < 13; k++) rows[at + k] = colourOf(rows[at + k]!);
    rows[at + 13] = 1 / (1 + Math.exp(-rows[at + 13]!));
  }
  return rows;
}

/** Whether a file begins as a PLY does. */
export function isPly(bytes: ArrayBuffer): boolean {
  return latin(bytes, 3) === 'ply';
}

/**
 * Checks a PLY of any kind before Spark reads it: it has as many bytes as its tables promise, and no
 * more splats than there may be.
 *
 * @throws PageError if it is otherwise
 */
export function checkPly(bytes: ArrayBuffer, name: string): void {
  const header = headerOf(bytes);
  const tables: { name: string | undefined; count: number; width: number }[] = [];
  for (const [word, ...words] of header?.lines ?? []) {
    if (word === 'element') tables.push({ name: words[0], count: COUNT.test(words[1] ?? '') ? Number(words[1]) : NaN, width: 0 });
    if (word === 'property' && tables.length > 0) tables.at(-1)!.width += words.length === 2 ? (WIDTHS[words[0]!] ?? NaN) : NaN;
  }
  const promised = tables.reduce((sum, { count, width }) => sum + count * width, header?.length ?? NaN);
  const splats = tables.filter((table) => table.name === 'vertex');
  const isRight = splats.length === 1 && isAllowed(splats[0]!.count) && tables.every(({ count, width }) => count === 0 || width > 0);
  if (!isRight || promised !== bytes.byteLength) throw unreadable(name);
}

/** The lines of a header as words, without comments, and its bytes; null where there is none. */
function headerOf(bytes: ArrayBuffer): { lines: string[][]; length: number } | null {
  const header = /^ply\r?\n([^]*?)\nend_header\r?\n/.exec(latin(bytes, MOST_HEADER));
  if (!header) return null;
  const lines = header[1]!.split('\n').map((line) => line.trim().split(/\s+/));
  return { lines: lines.filter(([word]) => word !== 'comment' && word !== 'obj_info'), length: header[0].length };
}

function latin(bytes: ArrayBuffer, most: number): string {
  return new TextDecoder('latin1').decode(new Uint8Array(bytes, 0, Math.min(most, bytes.byteLength)));
}
