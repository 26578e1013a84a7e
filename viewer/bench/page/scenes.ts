/** In the page: the animated person, and the same splats standing still, drawn as fast as can be. */
import { dyno, SplatMesh, type PackedSplats } from '@sparkjsdev/spark';
import * as THREE from 'three';
import type { BakedWindow } from '../../src/body/window.ts';
import { readBakedWindow } from '../../src/body/window.ts';
import { BundleFiles, loadManifest } from '../../src/bundle/load.ts';
import type { HeadFiles } from '../../src/bundle/load.ts';
import { ExpressionTrack } from '../../src/face/track.ts';
import { Poses } from '../../src/head/poses.ts';
import { drawFrames, type Frame } from './drawing.ts';

const STEP = 0.1; // s: windows change every ten frames
const { stage, head, body, director, conversation } = window.ico3d!;
const identity = await makeStill();
let sound = 0; // s
let uploaded = false;
perform();
window.scenes = { animated: (frames) => run(true, frames), still: (frames) => run(false, frames) };

/** Draws one scene. */
function run(animated: boolean, frames: number): Promise<Frame[]> {
  for (const object of [...head!.objects, ...body!.objects]) object.visible = animated;
  identity.visible = !animated;
  const change = () => {
    uploaded = false;
    if (animated) move();
    else identity.updateVersion();
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

/** The first window and the head as splats that go through an identity modifier. */
async function makeStill(): Promise<SplatMesh> {
  const manifest = await loadManifest();
  const info = manifest.body!.windows[0]!;
  const files = new BundleFiles(manifest.files);
  const window = readBakedWindow(await files.tensors(info.file), manifest.body!, info);
  const head = await files.head(manifest.head!);
  const mesh = new SplatMesh({
    constructSplats: (splats) => {
      addBody(splats, window);
      addHead(splats, head);
    },
    objectModifier: dyno.dynoBlock({ gsplat: dyno.Gsplat }, { gsplat: dyno.Gsplat }, ({ gsplat }) => ({ gsplat })),
  });
  await mesh.initialized;
  mesh.visible = false;
  stage.scene.add(mesh);
  return mesh;
}

function addBody(splats: PackedSplats, { info, means, scales, quats, rgba }: BakedWindow): void {
  for (let i = 0; i < info.num_gaussians; i++) {
    const [w, x, y, z] = quats.subarray(4 * i, 4 * i + 4);
    const [r, g, b, a] = rgba.subarray(4 * i, 4 * i + 4);
    splats.pushSplat(
      new THREE.Vector3().fromArray(means, 3 * i),
      new THREE.Vector3().fromArray(scales, 3 * i),
      new THREE.Quaternion(x, y, z, w).normalize(),
      a! / 255,
      new THREE.Color(r! / 255, g! / 255, b! / 255),
    );
  }
}

function addHead(splats: PackedSplats, { baked, poses }: HeadFiles): void {
  const place = new THREE.Object3D();
  new Poses(poses).apply(0, place);
  for (let i = 0; i < baked.count; i++) {
    const [w, x, y, z] = baked.quats.subarray(4 * i, 4 * i + 4);
    const [r, g, b, a] = baked.meanLogits.subarray(4 * i, 4 * i + 4).map((logit) => 1 / (1 + Math.exp(-logit)));
    splats.pushSplat(
      new THREE.Vector3().fromArray(baked.means, 3 * i).applyQuaternion(place.quaternion).add(place.position),
      new THREE.Vector3(...baked.scales.subarray(3 * i, 3 * i + 3).map(Math.exp)),
      new THREE.Quaternion(x, y, z, w).premultiply(place.quaternion).normalize(),
      a!,
      new THREE.Color(r!, g!, b!),
    );
  }
}
