/** In the page: the animated person, and the same splats standing still, drawn as fast as can be. */
import { ExpressionTrack } from '../../src/face/track.ts';
import { putToRest } from './at-rest.ts';
import { drawFrames, type Frame } from './drawing.ts';

const STEP = 0.1; // s: windows change every ten frames
const { stage, head, body, director, conversation } = window.ico3d!;
const identity = await putToRest(stage, [head!.generator, body!.objects[body!.shown!.slot]]);
let sound = 0; // s
let moves = false; // not in the first picture, which is compared
let uploaded = false;
perform();
window.scenes = { animated: (frames) => run(true, frames), still: (frames) => run(false, frames) };

/** Draws one scene. */
function run(animated: boolean, frames: number): Promise<Frame[]> {
  for (const object of [...head!.objects, ...body!.objects]) object.visible = animated;
  identity.visible = !animated;
  moves = frames > 1;
  const change = () => {
    uploaded = false;
    if (!animated) identity.updateVersion();
    else if (moves) move();
  };
  return drawFrames(stage, frames, change, () => ({ window: animated ? body!.shown!.window : -1, uploaded }));
}

/** One tick of a person who speaks and gestures through all of the recording, back and forth. */
function move(): void {
  sound += STEP;
  body!.tick(STEP);
  head!.tick(STEP);
}

/** Sound without end, a face that changes, and a plan from end to end. */
function perform(): void {
  const columns = head!.expression.length;
  const rows = 25 * 60;
  const values = Float32Array.from({ length: rows * columns }, () => Math.random() - 0.5);
  const track = new ExpressionTrack(25);
  track.add(0, { rows, columns, values });
  conversation!.player.heard = () => ({ utterance: 0, seconds: sound, track });
  director!.plan(0, Array.from({ length: 100 }, (_, i) => [3.2 * i, i % 2 ? Infinity : 0]));
  const [first, second] = body!.objects;
  for (const slot of [first, second]) {
    const hold = slot.hold.bind(slot);
    slot.hold = (content) => {
      uploaded = true;
      hold(content);
    };
  }
}
