import type { BodyInfo, WindowInfo } from '../bundle/manifest.ts';
import { takeTensor, type Tensor } from '../bundle/safetensors.ts';
import { PageError } from '../errors.ts';

/** A baked window of the body (`docs/bundle.md`): N Gaussians in C clusters, with P + R + L basis vectors each. */
export interface BakedWindow {
  info: WindowInfo;
  means: Float32Array; // (N,3) metres
  quats: Int16Array; // (N,4) wxyz · 32767
  scales: Float32Array; // (N,3) metres
  rgba: Uint8Array; // (N,4)
  clusters: Uint8Array; // (N,) index of each Gaussian's cluster
  positionBasis: Int16Array; // (P,N,3)
  rotationBasis: Int16Array; // (R,N,4)
  scaleBasis: Int16Array; // (L,N,3)
  curve: Curve;
}

/** Coefficients over the window's time. */
export interface Curve {
  samples: number; // number S of sampled times
  size: number; // number C·(P + R + L) of coefficients at a time
  rows: Float32Array; // (S + 2, C, P + R + L): with an extrapolated row before the first and after the last
}

/**
 * Takes a window's tensors out of its file.
 *
 * @throws PageError if they do not agree with the manifest's counts
 */
export function readBakedWindow(tensors: Map<string, Tensor>, body: BodyInfo, info: WindowInfo): BakedWindow {
  const { num_gaussians: n, num_clusters: c, ranks: [p, r, l], first, last, file } = info;
  const samples = body.samples_per_frame * (last - first) + 1;
  const take = <T>(name: string, dtype: Tensor['dtype'], shape: number[]): T =>
    takeTensor(tensors, name, dtype, shape, file).data as T;
  const clusters = take<Uint8Array>('clusters', 'U8', [n]);
  if (clusters.some((cluster) => cluster >= c)) throw new PageError(`${file}: clusters names one that is not there.`);
  return {
    info,
    clusters,
    means: take('means', 'F32', [n, 3]),
    quats: take('quats', 'I16', [n, 4]),
    scales: take('scales', 'F16', [n, 3]),
    rgba: take('rgba', 'U8', [n, 4]),
    positionBasis: take('position_basis', 'I16', [p, n, 3]),
    rotationBasis: take('rotation_basis', 'I16', [r, n, 4]),
    scaleBasis: take('scale_basis', 'I16', [l, n, 3]),
    curve: continued(take('coefficients', 'F32', [samples, c, p + r + l]), samples, c * (p + r + l)),
  };
}

/** Adds a row at either end, on the parabola through the three rows there. */
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
 * Writes the coefficients at a time of the window, by Catmull–Rom interpolation between sampled times.
 *
 * @param tau time, 0 at the window's first frame and 1 at its last
 * @param out (C, P + R + L) coefficients, written
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
