import * as THREE from 'three';
import type { SkinnedInfo } from '../../bundle/manifest.ts';
import { copy } from '../../numbers.ts';
import type { SkinnedRows } from './baked.ts';

const WIDTH = 1024; // texels per row: one texel of each layer is one Gaussian
const SHAPE = 6; // bytes of a residual shape
const TEXEL = 16; // bytes

/** Gaussians as texels of four 32-bit words; a Gaussian has one texel in each layer. */
export interface Texels {
  width: number;
  rows: number;
  layers: number;
  words: Uint32Array;
}

/** Room for all Gaussians of a body. */
export function makeTexels({ num_gaussians: count, num_shapes: shapes }: SkinnedInfo): Texels {
  const rows = Math.ceil(count / WIDTH);
  const layers = 3 + Math.ceil((SHAPE * shapes) / TEXEL);
  return { width: WIDTH, rows, layers, words: new Uint32Array(4 * WIDTH * rows * layers) };
}

/**
 * Lays Gaussians out for a texture, from number `begin` on, in the words that the shader unpacks.
 *
 * Layer 0: centre (3 floats), joints (4 bytes). Layer 1: rotation (4 shorts), weights (4 bytes), normal
 * and opacity (4 bytes). Layer 2: log scales (3 half floats), colour logits (3) and scales of the shapes
 * (2). Further layers: the residual shapes, 6 bytes each.
 */
export function fillTexels({ rows: height, words }: Texels, rows: SkinnedRows, begin: number): void {
  const layer = 4 * WIDTH * height; // words in a layer
  const size = rows.shapes.length / rows.count; // bytes of a Gaussian's shapes
  const floats = new Float32Array(words.buffer);
  const bytes = new Uint8Array(words.buffer);
  const signed = new Int8Array(words.buffer);
  const shorts = new Int16Array(words.buffer);
  const halves = new Uint16Array(words.buffer);
  for (let i = 0; i < rows.count; i++) {
    const a = 4 * (begin + i);
    const [b, c] = [a + layer, a + 2 * layer];
    copy(rows.means, 3 * i, 3, floats, a);
    copy(rows.joints, 4 * i, 4, bytes, 4 * (a + 3));
    copy(rows.quats, 4 * i, 4, shorts, 2 * b);
    copy(rows.weights, 4 * i, 4, bytes, 4 * (b + 2));
    copy(rows.normals, 3 * i, 3, signed, 4 * (b + 3));
    bytes[4 * (b + 3) + 3] = rows.opacities[i]!;
    for (let k = 0; k < 3; k++) {
      halves[2 * c + k] = THREE.DataUtils.toHalfFloat(rows.logScales[3 * i + k]!);
      halves[2 * c + 3 + k] = THREE.DataUtils.toHalfFloat(rows.colorLogits[3 * i + k]!);
    }
    for (let k = 0; k < 2; k++) halves[2 * c + 6 + k] = THREE.DataUtils.toHalfFloat(rows.shapeScales[2 * i + k]!);
    for (let at = 0; at < size; at += TEXEL) {
      copy(rows.shapes, size * i + at, Math.min(TEXEL, size - at), signed, 4 * (a + (3 + at / TEXEL) * layer));
    }
  }
}
