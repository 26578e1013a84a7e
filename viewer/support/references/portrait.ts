import { spawnSync } from 'node:child_process';
import { existsSync } from 'node:fs';
import { join } from 'node:path';
import { ENVIRONMENT, PYTHON, REPOSITORY, runPython } from '../python.ts';

const SHARED = join(REPOSITORY, '../shared');
const CLIP = join(SHARED, 'clips/portrait_a.mp4');

/** Where models that are no part of the repository may be. */
export const MODELS = join(SHARED, 'models');

/** Whether faces can be tracked. */
export const hasTracker = existsSync(join(MODELS, 'face_landmarker.task'));
const PERSONA = join(REPOSITORY, 'viewer/support/references/persona.json');

/** Whether there is a real recording to make an avatar of. */
export const hasClip = existsSync(CLIP);

const SECONDS = '2'; // of the clip
const SHORT =
  '--steps 150 --initial.gaussians 1000 --density.max-gaussians 1200 --density.begin 50 --density.until 100';

/** From a video of a person to an avatar that can be talked with: track, train, bake. */
export function makePortrait(folder: string): string {
  const [clip, capture, model, bundle] = ['clip.mp4', 'capture', 'model', 'portrait.ico3d'].map((name) => join(folder, name));
  runPython('references/short_clip.py', CLIP, clip!, SECONDS);
  ico3d('capture', 'portrait', clip!, capture!, '--size', '128', '--no-refine');
  ico3d('train', 'head', capture!, model!, '--preset', 'cpu', ...SHORT.split(' '));
  // Forced: half a minute of training need not reach what avatars for people must.
  ico3d('bake', model!, capture!, bundle!, '--persona', PERSONA, '--force', '--likeness', 'a test', '--consent', 'none needed', '--licence', 'tests', '--made-by', 'a test');
  return bundle!;
}

/** The packaged avatar where there is one, else a random head: with something to say. */
export function makeStandIn(folder: string, demo: string | null): string {
  const bundle = join(folder, 'stand-in.ico3d');
  runPython('references/talking_bundle.py', bundle, ...(demo ? [demo] : []));
  return bundle;
}

function ico3d(...words: string[]): void {
  const began = Date.now();
  const env = { ...ENVIRONMENT, ICO3D_MODELS: MODELS };
  const done = spawnSync(PYTHON, ['-m', 'ico3d.cli', ...words], { cwd: REPOSITORY, env, encoding: 'utf8' });
  if (done.status !== 0) throw new Error(`ico3d ${words.join(' ')}: ${done.stdout}${done.stderr}`);
  console.log(`ico3d ${words[0]} took ${((Date.now() - began) / 1000).toFixed(1)} s`);
}
