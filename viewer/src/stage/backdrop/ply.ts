import { MAX_GAUSSIANS } from '../../shared.ts';
import { colourOf, NUMBERS } from './rows.ts';

const MOST_HEADER = 1 << 16; // bytes
const READ = ['x', 'y', 'z', 'rot_0', 'rot_1', 'rot_2', 'rot_3', 'scale_0', 'scale_1', 'scale_2', 'f_dc_0', 'f_dc_1', 'f_dc_2', 'opacity'];

/**
 * Reads a PLY file as the first 3D Gaussian Splatting wrote them: a table of floats, scales as
 * logarithms, opacities as logits, colours as harmonics.
 *
 * @returns rows as `readSplats` gives them; null if it is of another kind
 */
export function readPly(bytes: ArrayBuffer): Float32Array | null {
  const header = /^ply\r?\n([^]*?)\nend_header\r?\n/.exec(new TextDecoder('latin1').decode(new Uint8Array(bytes, 0, Math.min(MOST_HEADER, bytes.byteLength))));
  if (!header) return null;
  const lines = header[1]!.split('\n').map((line) => line.trim().split(/\s+/)).filter(([word]) => word !== 'comment' && word !== 'obj_info');
  const [format, table, ...properties] = lines;
  const named = properties.map(([word, type, name]) => (word === 'property' && (type === 'float' || type === 'float32') ? name : null));
  const columns = READ.map((name) => named.indexOf(name));
  const isKnown = format?.[1] === 'binary_little_endian' && table?.[0] === 'element' && table[1] === 'vertex';
  if (!isKnown || named.includes(null) || columns.includes(-1)) return null;
  const [count, stride] = [Number(table[2]), 4 * properties.length];
  if (!(count <= MAX_GAUSSIANS) || bytes.byteLength !== header[0].length + count * stride) return null;
  const data = new DataView(bytes, header[0].length);
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
