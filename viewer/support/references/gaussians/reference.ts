import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import type { Source } from '../../../src/soft/source.ts';
import { runFork } from '../../python.ts';
import { scratchFolder } from '../../scratch.ts';
import { arrayBuffer } from '../head.ts';

const NUMBERS = 14; // of a Gaussian, as Python writes them

/** Gaussians at rest, and Python's picture of them (`gaussians_reference.py`). */
export interface GaussiansReference {
  source: Source;
  view: Float32Array; // (3,4) camera from world
  lens: [number, number, number, number];
  background: [number, number, number];
  picture: Uint8Array; // (H,W,3)
}

/** Draws random Gaussians, or those of a bundle, with Python. */
export function makeGaussians(options: { bundle?: string; gaussians?: number; size: string }): GaussiansReference {
  const out = scratchFolder();
  runFork('references/gaussians/gaussians_reference.py', out, ...Object.entries(options).flatMap(([name, value]) => [`--${name}`, String(value)]));
  const given = new Float32Array(arrayBuffer(readFileSync(join(out, 'gaussians.f32'))));
  const count = given.length / NUMBERS;
  const rows = new Float32Array(16 * count);
  for (let i = 0; i < count; i++) rows.set(given.subarray(NUMBERS * i, NUMBERS * (i + 1)), 16 * i);
  const { view, lens, background } = JSON.parse(readFileSync(join(out, 'view.json'), 'utf8')) as {
    view: number[][];
    lens: GaussiansReference['lens'];
    background: GaussiansReference['background'];
  };
  const source: Source = { kind: 'still', count, rows: rows.buffer, sizes: [] };
  return { source, lens, background, view: Float32Array.from(view.flat()), picture: readFileSync(join(out, 'picture.u8')) };
}
