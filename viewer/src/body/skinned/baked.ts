import type { SkinnedInfo } from '../../bundle/manifest.ts';
import { takeTensor, type Tensor } from '../../bundle/safetensors.ts';
import { PageError } from '../../errors.ts';

/** A baked body on a skeleton (`docs/bundle.md`): N Gaussians, J joints, K residual shapes, F recorded poses. */
export interface BakedSkinned {
  info: SkinnedInfo;
  means: Float32Array; // (N,3) metres at rest
  quats: Int16Array; // (N,4) wxyz · 32767
  logScales: Float32Array; // (N,3)
  colorLogits: Float32Array; // (N,3)
  opacities: Uint8Array; // (N,) · 255
  normals: Int8Array; // (N,3)
  joints: Uint8Array; // (N,4)
  weights: Uint8Array; // (N,4) · 255
  shapes: Int8Array; // (N,K,6) position, logits
  shapeScales: Float32Array; // (N,2) millimetres and logits per unit
  light: Float32Array; // (8,3)
  poses: RecordedPoses;
}

/** How the body was recorded to stand, and its skeleton. */
export interface RecordedPoses {
  joints: Float32Array; // (J,3) metres at rest
  held: Int16Array; // (J,4) wxyz · 32767 of joints that never turn
  moving: Uint8Array; // (M,) joints that turn
  rotations: Int16Array; // (F,M,4) theirs
  roots: Float32Array; // (F,3) metres
  coefficients: Float32Array; // (F,K)
  known: Int16Array; // (P,) frames
  kernelWidth: number;
}

/** Takes a body's tensors out of its file, checked against the manifest's counts. */
export function readBakedSkinned(tensors: Map<string, Tensor>, info: SkinnedInfo, file: string): BakedSkinned {
  const { num_gaussians: n, num_shapes: k, num_frames: f, num_moving: m, num_known: p } = info;
  const j = info.names.length;
  const take = <T>(name: string, dtype: Tensor['dtype'], shape: number[]): T =>
    takeTensor(tensors, name, dtype, shape, file).data as T;
  const joints = take<Uint8Array>('joints', 'U8', [n, 4]);
  const moving = take<Uint8Array>('moving', 'U8', [m]);
  const known = take<Int16Array>('known', 'I16', [p]);
  const missing = (name: string) => new PageError(`${file}: ${name} names one that is not there.`);
  if (joints.some((joint) => joint >= j)) throw missing('joints');
  if (moving.some((joint) => joint >= j)) throw missing('moving');
  if (known.some((frame) => frame < 0 || frame >= f)) throw missing('known');
  const [kernelWidth] = take<Float32Array>('kernel_width', 'F32', [1]);
  if (!(kernelWidth! > 0)) throw new PageError(`${file}: kernel_width must be more than 0.`);
  return {
    info,
    joints,
    means: take('means', 'F32', [n, 3]),
    quats: take('quats', 'I16', [n, 4]),
    logScales: take('log_scales', 'F16', [n, 3]),
    colorLogits: take('color_logits', 'F16', [n, 3]),
    opacities: take('opacities', 'U8', [n]),
    normals: take('normals', 'I8', [n, 3]),
    weights: take('weights', 'U8', [n, 4]),
    shapes: take('shapes', 'I8', [n, k, 6]),
    shapeScales: take('shape_scales', 'F16', [n, 2]),
    light: take('light', 'F32', [8, 3]),
    poses: {
      moving,
      known,
      kernelWidth: kernelWidth!,
      joints: take('rig_joints', 'F32', [j, 3]),
      held: take('held', 'I16', [j, 4]),
      rotations: take('rotations', 'I16', [f, m, 4]),
      roots: take('roots', 'F32', [f, 3]),
      coefficients: take('coefficients', 'F32', [f, k]),
    },
  };
}
