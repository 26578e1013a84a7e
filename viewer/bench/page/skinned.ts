/** In the page: the body on a skeleton that moves, and the same splats at rest. */
import { loadManifest } from '../../src/bundle/load.ts';
import { putToRest } from './at-rest.ts';
import { drawFrames } from './drawing.ts';

const STEP = 0.1; // s
const { stage, skinned } = window.ico3d!;
const { fps, num_frames } = (await loadManifest((name) => `bundle/${name}`)).skinned!;
const rest = skinned!.generator.skeleton.empty();
skinned!.strike(rest.rotations, rest.root);
await stage.still();
const identity = await putToRest(stage, skinned!.objects);
let seconds = 0;
let moves = false; // not in the first picture, which is compared
window.scenes = { animated: (frames) => run(true, frames), still: (frames) => run(false, frames) };

function run(animated: boolean, frames: number) {
  skinned!.generator.visible = animated;
  identity.visible = !animated;
  const seen = { window: -1, uploaded: false };
  moves = frames > 1;
  return drawFrames(stage, frames, animated ? move : () => identity.updateVersion(), () => seen);
}

/** A pose of the recording, with coefficients as if it had never been recorded: all that a frame may cost. */
function move(): void {
  const { skeleton } = skinned!.generator;
  const pose = skeleton.empty();
  if (moves) skeleton.recorded((seconds += STEP) * fps % (num_frames - 1), pose);
  skinned!.strike(pose.rotations, pose.root);
}
