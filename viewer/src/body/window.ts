import type { BodyInfo, WindowInfo } from '../bundle/manifest.ts';
import { takeTensor, type Tensor } from '../bundle/safetensors.ts';

/** A baked window of the body (`docs/bundle.md`): N Gaussians that move in P + R + L ways. */
export interface BakedWindow {
  info: WindowInfo;
  means: Float32Array; // (N,3) metres
  quats: Int16Array; // (N,4) wxyz · 32767
  scales: Float32Array; // (N,3) log of metres
  rgba: Uint8Array; // (N,4)
  positionBasis: Int16Array; // (P,N,3) in BASIS_STEPs, as the next two
  rotationBasis: Int16Array; // (R,N,4)
  scaleBasis: Int16Array; // (L,N,3)
  curve: Curve;
}

/** What 1 in the file's bases is, times the Gaussian's unit (at most 1), in a 16-bit texture. */
export const BASIS_STEP = 258;

/** Coefficients over the window's time. */
export interface Curve {
  samples: number; // S
  size: number; // P + R + L
  rows: Float32Array; // (S + 2, P + R + L): one more row before the first and after the last
}

/** Takes a window's tensors out of its file, checked against the manifest's counts. */
export function readBakedWindow(tensors: Map<string, Tensor>, body: BodyInfo, info: WindowInfo): BakedWindow {
  const { num_gaussians: n, ranks: [p, r, l], first, last, file } = info;
  const samples = body.samples_per_frame * (last - first) + 1;
  const take = <T>(name: string, dtype: Tensor['dtype'], shape: number[]): T =>
    takeTensor(tensors, name, dtype, shape, file).data as T;
  const means = take<Float32Array>('means', 'F32', [n, 3]);
  const units = take<Float32Array>('units', 'F16', [n, 3]);
  const basis = (name: string, rank: number, size: number, part: number): Int16Array => {
    const steps = take<Int8Array>(name, 'I8', [rank, n, size]);
    return Int16Array.from(steps, (value, i) => {
      const gaussian = Math.floor(i / size) % n;
      return Math.round(BASIS_STEP * value * Math.min(units[3 * gaussian + part]!, 1));
    });
  };
  return {
    info,
    means,
    quats: take('quats', 'I16', [n, 4]),
    scales: take('scales', 'F16', [n, 3]),
    rgba: take('rgba', 'U8', [n, 4]),
    positionBasis: basis('position_basis', p, 3, 0),
    rotationBasis: basis('rotation_basis', r, 4, 1),
    scaleBasis: basis('scale_basis', l, 3, 2),
    curve: continued(take('coefficients', 'F32', [samples, p + r + l]), samples, p + r + l),
  };
}

/** Goes on with the parabola through the last three rows at either end. */
function continued(given: Float32Array, samples: number, size: number): Curve {
  const rows = new Float32Array((samples + 2) * size);
  rows.set(given, size);
  const end = samples - 1;
  for (let k = 0; k < size; k++) {
    const at = (row: number) => given[row * size + k]!;
    rows[k] = 3 * at(0) - 3 * at(1) + at(2);
    rows[(samples + 1) * size + k] = 3 * at(end) - 3 * at(end - 1) + at(end - 2);
  }
  return { samples, size, rows };
}

/**
 * The coefficients at a time of the window: Catmull–Rom between the sampled times.
 *
 * @param tau 0 at the window's first frame, 1 at its last
 * @param out (P + R + L,) receives them
 */
export function coefficientsAt({ samples, size, rows }: Curve, tau: number, out: Float32Array): void {
  const place = Math.min(Math.max(tau, 0), 1) * (samples - 1);
  const index = Math.min(Math.floor(place), samples - 2);
  const x = place - index;
  const before = (((2 - x) * x - 1) * x) / 2;
  const here = ((3 * x - 5) * x * x + 2) / 2;
  const next = (((4 - 3 * x) * x + 1) * x) / 2;
  const after = ((x - 1) * x * x) / 2;
  for (let k = 0; k < size; k++) {
    const at = index * size + k;
    out[k] = before * rows[at]! + here * rows[at + size]! + next * rows[at + 2 * size]! + after * rows[at + 3 * size]!;
  }
}
