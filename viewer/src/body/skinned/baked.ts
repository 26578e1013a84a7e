import type { SkinnedInfo } from '../../bundle/manifest.ts';
import { takeTensor, type Tensor } from '../../bundle/safetensors.ts';
import { PageError } from '../../errors.ts';

/** Gaussians of a body on a skeleton: N of them, with K residual shapes. */
export interface SkinnedRows {
  count: number; // N
  means: Float32Array; // (N,3) metres at rest
  quats: Int16Array; // (N,4) wxyz · 32767
  logScales: Float32Array; // (N,3) logarithms of metres
  colorLogits: Float32Array; // (N,3) logits of r, g, b
  opacities: Uint8Array; // (N,) · 255
  normals: Int8Array; // (N,3) directions in which the surface faces at rest, of any length
  joints: Uint8Array; // (N,4) indices of the joints that carry each Gaussian
  weights: Uint8Array; // (N,4) weights of these joints · 255
  shapes: Int8Array; // (N,K,6) residual shapes: changes of position and of logits
  shapeScales: Float32Array; // (N,2) millimetres and logits per unit of the shapes
}

/** A baked body on a skeleton (`docs/bundle.md`): its Gaussians, or the most important ones, J joints, F recorded frames. */
export interface BakedSkinned extends SkinnedRows {
  info: SkinnedInfo;
  light: Float32Array; // (8,3) coefficients of spherical harmonics of degrees 1 and 2
  poses: RecordedPoses;
  lamp: BakedLamp | null;
}

/** The strongest lamp, and M spheres just under the skin that stand in its light (`docs/bundle.md`). */
export interface BakedLamp {
  direction: Float32Array; // (3,) towards the lamp, 1 long
  strength: Float32Array; // (3,) r, g, b
  points: Int16Array; // (M,3) at rest, 0.1 mm
  joints: Uint8Array; // (M,4)
  weights: Uint8Array; // (M,4) · 255
}

/** The skeleton and its recorded poses. */
export interface RecordedPoses {
  joints: Float32Array; // (J,3) positions at rest, metres
  held: Int16Array; // (J,4) local rotations wxyz · 32767 of the joints that do not turn in the recording
  moving: Uint8Array; // (M,) indices of the joints that turn
  rotations: Int16Array; // (F,M,4) local rotations wxyz · 32767 of the joints `moving` in each frame
  roots: Float32Array; // (F,3) translation of the root from rest, metres
  coefficients: Float32Array; // (F,K) coefficients of the residual shapes in each frame
  known: Int16Array; // (P,) frames from which coefficients of other poses are interpolated
  kernelWidth: number; // width of the kernel of that interpolation, in units of a pose's features
}

/**
 * Takes a body's tensors out of its first file.
 *
 * @throws PageError if they do not agree with the manifest's counts, or an index is out of range
 */
export function readBakedSkinned(tensors: Map<string, Tensor>, info: SkinnedInfo, file: string): BakedSkinned {
  const { num_shapes: k, num_frames: f, num_moving: m, num_known: p } = info;
  const j = info.names.length;
  const take = <T>(name: string, dtype: Tensor['dtype'], shape: number[]): T =>
    takeTensor(tensors, name, dtype, shape, file).data as T;
  const moving = take<Uint8Array>('moving', 'U8', [m]);
  const known = take<Int16Array>('known', 'I16', [p]);
  if (moving.some((joint) => joint >= j)) throw missing('moving', file);
  if (known.some((frame) => frame < 0 || frame >= f)) throw missing('known', file);
  const [kernelWidth] = take<Float32Array>('kernel_width', 'F32', [1]);
  if (!(kernelWidth! > 0)) throw new PageError(`${file}: kernel_width must be more than 0.`);
  return {
    info,
    ...readSkinnedRows(tensors, info.num_gaussians - info.num_rest, info, file),
    lamp: info.num_casters ? readLamp(tensors, info, file) : null,
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

/**
 * Takes `n` Gaussians of a body out of a file.
 *
 * @throws PageError if they do not agree with the manifest's counts, or one hangs on a joint that is not there
 */
export function readSkinnedRows(tensors: Map<string, Tensor>, n: number, info: SkinnedInfo, file: string): SkinnedRows {
  const take = <T>(name: string, dtype: Tensor['dtype'], shape: number[]): T =>
    takeTensor(tensors, name, dtype, shape, file).data as T;
  const joints = take<Uint8Array>('joints', 'U8', [n, 4]);
  if (joints.some((joint) => joint >= info.names.length)) throw missing('joints', file);
  return {
    count: n,
    joints,
    means: take('means', 'F32', [n, 3]),
    quats: take('quats', 'I16', [n, 4]),
    logScales: take('log_scales', 'F16', [n, 3]),
    colorLogits: take('color_logits', 'F16', [n, 3]),
    opacities: take('opacities', 'U8', [n]),
    normals: take('normals', 'I8', [n, 3]),
    weights: take('weights', 'U8', [n, 4]),
    shapes: take('shapes', 'I8', [n, info.num_shapes, 6]),
    shapeScales: take('shape_scales', 'F16', [n, 2]),
  };
}

function missing(name: string, file: string): PageError {
  return new PageError(`${file}: ${name} names one that is not there.`);
}

function readLamp(tensors: Map<string, Tensor>, info: SkinnedInfo, file: string): BakedLamp {
  const m = info.num_casters;
  const take = <T>(name: string, dtype: Tensor['dtype'], shape: number[]): T =>
    takeTensor(tensors, name, dtype, shape, file).data as T;
  const lamp: BakedLamp = {
    direction: take('lamp_direction', 'F32', [3]),
    strength: take('lamp_strength', 'F32', [3]),
    points: take('caster_points', 'I16', [m, 3]),
    joints: take('caster_joints', 'U8', [m, 4]),
    weights: take('caster_weights', 'U8', [m, 4]),
  };
  if (lamp.joints.some((joint) => joint >= info.names.length)) throw new PageError(`${file}: caster_joints names one that is not there.`);
  if (Math.abs(Math.hypot(...lamp.direction) - 1) > 1e-3) throw new PageError(`${file}: lamp_direction is not of length 1.`);
  if (lamp.strength.some((value) => value < 0)) throw new PageError(`${file}: lamp_strength must not be less than 0.`);
  return lamp;
}
