import { existsSync } from 'node:fs';
import { join } from 'node:path';
import { REPOSITORY, runFork, runPython } from '../python.ts';

const SHARED = join(REPOSITORY, '../shared');
const CLIP = join(SHARED, 'clips/portrait_a.mp4');

/** Where models that are no part of the repository may be. */
export const MODELS = join(SHARED, 'models');

/** Whether faces can be tracked. */
export const hasTracker = existsSync(join(MODELS, 'face_landmarker.task'));

/** Whether there is a real recording to make an avatar of. */
export const hasClip = existsSync(CLIP);

/** From a video of a person to an avatar that can be talked with: track, train, bake (`portrait.py`). */
export function makePortrait(folder: string): string {
  runFork('references/portrait.py', CLIP, folder, MODELS);
  return join(folder, 'portrait.ico3d');
}

/** The packaged avatar where there is one, else a random head: with something to say. */
export function makeStandIn(folder: string, demo: string | null): string {
  const bundle = join(folder, 'stand-in.ico3d');
  runPython('references/talking_bundle.py', bundle, ...(demo ? [demo] : []));
  return bundle;
}
