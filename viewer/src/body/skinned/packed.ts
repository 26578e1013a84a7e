import * as THREE from 'three';
import type { BakedSkinned } from './baked.ts';

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

/**
 * Lays a body out for a texture, in the words that the shader unpacks.
 *
 * Layer 0: centre (3 floats), joints (4 bytes). Layer 1: rotation (4 shorts), weights (4 bytes), normal
 * and opacity (4 bytes). Layer 2: log scales (3 half floats), colour logits (3) and scales of the shapes
 * (2). Further layers: the residual shapes, 6 bytes each.
 */
export function packSkinned(baked: BakedSkinned): Texels {
  const { num_gaussians: count, num_shapes: shapes } = baked.info;
  const rows = Math.ceil(count / WIDTH);
  const shapeLayers = Math.ceil((SHAPE * shapes) / TEXEL);
  const layers = 3 + shapeLayers;
  const words = new Uint32Array(4 * WIDTH * rows * layers);
  const layer = 4 * WIDTH * rows; // words in a layer
  const floats = new Float32Array(words.buffer);
  const bytes = new Uint8Array(words.buffer);
  const signed = new Int8Array(words.buffer);
  const shorts = new Int16Array(words.buffer);
  const halves = new Uint16Array(words.buffer);
  for (let i = 0; i < count; i++) {
    const [a, b, c] = [4 * i, 4 * i + layer, 4 * i + 2 * layer];
    floats.set(baked.means.subarray(3 * i, 3 * i + 3), a);
    bytes.set(baked.joints.subarray(4 * i, 4 * i + 4), 4 * (a + 3));
    shorts.set(baked.quats.subarray(4 * i, 4 * i + 4), 2 * b);
    bytes.set(baked.weights.subarray(4 * i, 4 * i + 4), 4 * (b + 2));
    signed.set(baked.normals.subarray(3 * i, 3 * i + 3), 4 * (b + 3));
    bytes[4 * (b + 3) + 3] = baked.opacities[i]!;
    for (let k = 0; k < 3; k++) {
      halves[2 * c + k] = THREE.DataUtils.toHalfFloat(baked.logScales[3 * i + k]!);
      halves[2 * c + 3 + k] = THREE.DataUtils.toHalfFloat(baked.colorLogits[3 * i + k]!);
    }
    for (let k = 0; k < 2; k++) halves[2 * c + 6 + k] = THREE.DataUtils.toHalfFloat(baked.shapeScales[2 * i + k]!);
    const row = baked.shapes.subarray(SHAPE * shapes * i, SHAPE * shapes * (i + 1));
    for (let at = 0; at < shapeLayers; at++) {
      signed.set(row.subarray(TEXEL * at, TEXEL * (at + 1)), 4 * (4 * i + (3 + at) * layer));
    }
  }
  return { width: WIDTH, rows, layers, words };
}
