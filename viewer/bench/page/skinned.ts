/** In the page: the body on a skeleton that moves, and the same splats at rest. */
import { dyno, SplatMesh, type PackedSplats } from '@sparkjsdev/spark';
import * as THREE from 'three';
import { readBakedSkinned, type BakedSkinned } from '../../src/body/skinned/baked.ts';
import { BundleFiles, loadManifest, SKINNED } from '../../src/bundle/load.ts';
import { drawFrames } from './drawing.ts';

const STEP = 0.1; // s
const { stage, skinned } = window.ico3d!;
const manifest = await loadManifest();
const baked = readBakedSkinned(await new BundleFiles(manifest.files).tensors(SKINNED), manifest.skinned!, SKINNED);
const identity = await makeStill();
const rest = skinned!.generator.skeleton.empty();
skinned!.strike(rest.rotations, rest.root);
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
  if (moves) skeleton.recorded((seconds += STEP) * baked.info.fps % (baked.info.num_frames - 1), pose);
  skinned!.strike(pose.rotations, pose.root);
}

/** The body at rest as splats that go through an identity modifier. */
async function makeStill(): Promise<SplatMesh> {
  const mesh = new SplatMesh({
    constructSplats: (splats) => addBody(splats, baked),
    objectModifier: dyno.dynoBlock({ gsplat: dyno.Gsplat }, { gsplat: dyno.Gsplat }, ({ gsplat }) => ({ gsplat })),
  });
  await mesh.initialized;
  mesh.visible = false;
  stage.scene.add(mesh);
  return mesh;
}

function addBody(splats: PackedSplats, { info, means, logScales, quats, colorLogits, opacities }: BakedSkinned): void {
  for (let i = 0; i < info.num_gaussians; i++) {
    const [w, x, y, z] = quats.subarray(4 * i, 4 * i + 4);
    const [r, g, b] = colorLogits.subarray(3 * i, 3 * i + 3).map((logit) => 1 / (1 + Math.exp(-logit)));
    splats.pushSplat(
      new THREE.Vector3().fromArray(means, 3 * i),
      new THREE.Vector3(...logScales.subarray(3 * i, 3 * i + 3).map(Math.exp)),
      new THREE.Quaternion(x, y, z, w).normalize(),
      opacities[i]! / 255,
      new THREE.Color(r!, g!, b!),
    );
  }
}
