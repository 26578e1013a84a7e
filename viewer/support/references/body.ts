import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { runFork } from '../python.ts';
import { arrayBuffer } from './head.ts';
import { scratchFolder } from '../scratch.ts';

/** What Python makes of one moment of a body. */
export interface Moment {
  time: number; // s
  window: number;
  tau: number;
  coefficients: number[];
  centres: Float32Array; // (N,3)
  rgba: Float32Array; // (N,4)
}

/** A body that swings its arms (`body_reference.py`). */
export interface BodyReference {
  file: string; // NAME.ico3d
  folder: string; // the bundle's files
  moments: Moment[];
  pictures: Buffer | null; // (T, H, W, 3)
}

/** Bakes the body and evaluates it with Python at some times. */
export function makeBody(options: { gaussians: number; times: number[]; pictures?: string }): BodyReference {
  const out = scratchFolder();
  const args = ['--gaussians', String(options.gaussians), '--times', options.times.join()];
  if (options.pictures) args.push('--pictures', options.pictures);
  runFork('references/body_reference.py', out, ...args);
  const folder = join(out, 'bundle');
  const { windows } = JSON.parse(readFileSync(join(folder, 'manifest.json'), 'utf8')).body;
  const moments = JSON.parse(readFileSync(join(out, 'reference.json'), 'utf8')) as Moment[];
  const splats = new Float32Array(arrayBuffer(readFileSync(join(out, 'splats.f32'))));
  let at = 0;
  for (const moment of moments) {
    const count = windows[moment.window].num_gaussians as number;
    const rows = splats.subarray(7 * at, 7 * (at + count));
    moment.centres = rows.filter((_, i) => i % 7 < 3);
    moment.rgba = rows.filter((_, i) => i % 7 >= 3);
    at += count;
  }
  const pictures = options.pictures ? readFileSync(join(out, 'pictures.u8')) : null;
  return { file: join(out, 'body.ico3d'), folder, moments, pictures };
}
