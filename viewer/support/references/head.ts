import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { runFork } from '../python.ts';
import { scratchFolder } from '../scratch.ts';

/** What Python makes of a bundle (`head_reference.py`). */
export interface Reference {
  file: string; // NAME.ico3d
  folder: string; // the bundle's files
  expressions: number[][];
  coefficients: number[][];
  attributes: Float32Array; // (E, N, 4)
  pictures: Buffer | null; // (E, H, W, 3)
}

/** Writes a random bundle, or takes `bundle`, and evaluates it with Python. */
export function makeReference(options: { bundle?: string; gaussians?: number; pictures?: string; shoulders?: true }): Reference {
  const out = scratchFolder();
  const args = Object.entries(options).flatMap(([name, value]) => (value === true ? [`--${name}`] : [`--${name}`, String(value)]));
  runFork('references/head_reference.py', out, ...args);
  const json = JSON.parse(readFileSync(join(out, 'reference.json'), 'utf8')) as Reference;
  return {
    file: options.bundle ?? join(out, 'random.ico3d'),
    folder: join(out, 'bundle'),
    expressions: json.expressions,
    coefficients: json.coefficients,
    attributes: new Float32Array(arrayBuffer(readFileSync(join(out, 'attributes.f32')))),
    pictures: options.pictures ? readFileSync(join(out, 'pictures.u8')) : null,
  };
}

/** A file's bytes as a buffer of their own. */
export function arrayBuffer(bytes: Buffer): ArrayBuffer {
  return bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength) as ArrayBuffer;
}
