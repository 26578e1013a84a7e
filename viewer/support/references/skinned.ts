import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { runFork } from '../python.ts';
import { scratchFolder } from '../scratch.ts';
import { arrayBuffer } from './head.ts';

/** What Python makes of one pose. */
export interface SkinnedMoment {
  time: number | null; // s; null of the pose that was never recorded
  rotations: number[]; // (J,4)
  root: number[];
  residual: number[];
  table: number[]; // (J,16)
  centres: Float32Array; // (N,3)
  rgba: Float32Array; // (N,4)
}

/** A body on a skeleton (`skinned_reference.py`). */
export interface SkinnedReference {
  file: string; // NAME.ico3d
  folder: string; // the bundle's files
  moments: SkinnedMoment[]; // of the times, then of a pose that was never recorded
  pictures: Buffer | null; // (M + 1, H, W, 3): the last one with few Gaussians
}

/** Writes the body and evaluates it with Python at some times. */
export function makeSkinned(options: { gaussians: number; times: number[]; few?: number; pictures?: string }): SkinnedReference {
  const out = scratchFolder();
  const args = ['--gaussians', String(options.gaussians), '--times', options.times.join(), '--few', String(options.few ?? 1)];
  if (options.pictures) args.push('--pictures', options.pictures);
  runFork('references/skinned_reference.py', out, ...args);
  const moments = JSON.parse(readFileSync(join(out, 'reference.json'), 'utf8')) as SkinnedMoment[];
  const splats = new Float32Array(arrayBuffer(readFileSync(join(out, 'splats.f32'))));
  moments.forEach((moment, i) => {
    const rows = splats.subarray(7 * options.gaussians * i, 7 * options.gaussians * (i + 1));
    moment.centres = rows.filter((_, at) => at % 7 < 3);
    moment.rgba = rows.filter((_, at) => at % 7 >= 3);
  });
  const pictures = options.pictures ? readFileSync(join(out, 'pictures.u8')) : null;
  return { file: join(out, 'body.ico3d'), folder: join(out, 'bundle'), moments, pictures };
}
