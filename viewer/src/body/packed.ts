import { roomFor, type BodyInfo } from '../bundle/manifest.ts';
import type { BakedWindow, Curve } from './window.ts';

const WIDTH = 1024; // texels per row: one texel is one Gaussian

/** The size of a slot's textures, in which every window of the body fits. */
export interface Capacity {
  count: number; // Gaussians
  width: number; // texels per row
  rows: number;
  clusters: number;
  ranks: [number, number, number]; // numbers of basis vectors of positions, rotations, scales
}

/** A window in the layout of a slot's textures. */
export interface PackedWindow {
  window: BakedWindow['info'];
  curve: Curve;
  means: Float32Array; // (N,3) metres
  rest: Float32Array; // 2 layers of texels: centre with cluster, and scales
  colours: Uint8Array; // 1 layer of texels: red, green, blue, opacity
  basis: Int16Array; // 1 + P + R + L layers of texels: quaternion, basis of positions, of rotations, of scales
}

/** The capacity that suffices for all windows of a body. */
export function capacityOf(body: BodyInfo): Capacity {
  const room = roomFor(body);
  return { ...room, width: WIDTH, rows: Math.ceil(room.count / WIDTH) };
}

/** Number of texels that a window's basis takes in the textures of a capacity. */
export function texelsOf({ width, rows, ranks }: Capacity): number {
  return width * rows * (1 + ranks[0] + ranks[1] + ranks[2]);
}

/** Lays a window out for the textures of a capacity; what it does not fill is 0. */
export function pack(window: BakedWindow, capacity: Capacity): PackedWindow {
  const { width, rows, ranks } = capacity;
  const layer = 4 * width * rows;
  const rest = new Float32Array(2 * layer);
  spread(window.means, 3, rest, 0);
  spread(window.scales, 3, rest, layer);
  window.clusters.forEach((cluster, i) => (rest[4 * i + 3] = cluster));
  const colours = new Uint8Array(layer);
  colours.set(window.rgba);
  const basis = new Int16Array(4 * texelsOf(capacity));
  basis.set(window.quats);
  const parts = [window.positionBasis, window.rotationBasis, window.scaleBasis];
  let begin = layer;
  parts.forEach((part, i) => {
    const size = i === 1 ? 4 : 3;
    const length = size * window.info.num_gaussians;
    for (let k = 0; k < window.info.ranks[i]!; k++) {
      spread(part.subarray(k * length, (k + 1) * length), size, basis, begin + k * layer);
    }
    begin += ranks[i]! * layer;
  });
  return { window: window.info, curve: window.curve, means: window.means, rest, colours, basis };
}

/** Writes rows of 3 or 4 values into texels of 4, from `begin` on. */
function spread<T extends Float32Array | Int16Array>(values: T, size: number, texels: T, begin: number): void {
  if (size === 4) {
    texels.set(values, begin);
    return;
  }
  for (let from = 0, to = begin; from < values.length; from += 3, to += 4) {
    texels[to] = values[from]!;
    texels[to + 1] = values[from + 1]!;
    texels[to + 2] = values[from + 2]!;
  }
}

/** Number of texels that the coefficients of a cluster take, four in each. */
export function coefficientTexels(ranks: Capacity['ranks']): number {
  return Math.ceil((ranks[0] + ranks[1] + ranks[2]) / 4);
}

/** For each of a window's (C, P + R + L) coefficients, its index in the texture of a capacity's coefficients. */
export function coefficientPlaces(window: BakedWindow['info'], { ranks }: Capacity): number[] {
  const begins = [0, ranks[0], ranks[0] + ranks[1]];
  const row = window.ranks.flatMap((rank, part) => Array.from({ length: rank }, (_, k) => begins[part]! + k));
  const width = 4 * coefficientTexels(ranks);
  return Array.from({ length: window.num_clusters }, (_, c) => row.map((k) => c * width + k)).flat();
}
