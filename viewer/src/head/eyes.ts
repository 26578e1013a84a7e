import type { BakedHead } from '../bundle/baked-head.ts';
import { blinkIndices, type HeadInfo } from '../bundle/manifest.ts';
import { coefficients } from './coefficients.ts';

/**
 * Where eyes may be in canonical head space, m. Its origin lies behind them, as high as they are or
 * (MediaPipe's face) up to 3 cm lower; x is 0 between them.
 */
const SOUGHT = { aside: 0.08, low: -0.045, high: 0.065, behind: 0 };
/** Gaussians that are looked at: many more tell the same place, in seconds. */
const MOST = 20_000;
const USUAL: [number, number, number] = [0, 0.01, 0.06];

/**
 * The point between the eyes in canonical head space, m: where the face changes when its lids close.
 * No two trackers put the origin at the same place of the face; every trained face blinks.
 */
export function eyesOf(head: BakedHead, info: HeadInfo): [number, number, number] {
  const change = changeByBlinking(head, info);
  const near = sampled(head.count, (i) => isSought(head, i));
  const changed = near.map((i) => [i, change(i)] as const).filter(([, weight]) => weight > 0);
  if (changed.length === 0) return USUAL;
  const middle = (axis: number) => weightedMedian(changed.map(([i, weight]) => [head.means[3 * i + axis]!, weight]));
  return [0, middle(1), middle(2)];
}

/** Gaussians of `count` that meet a condition: every one, or evenly chosen ones where they are many. */
export function sampled(count: number, met: (i: number) => boolean): number[] {
  const all = Array.from({ length: count }, (_, i) => i).filter(met);
  const step = Math.ceil(all.length / MOST);
  return all.filter((_, place) => place % step === 0);
}

function isSought({ means }: BakedHead, i: number): boolean {
  const [x, y, z] = means.subarray(3 * i);
  return Math.abs(x!) < SOUGHT.aside && y! > SOUGHT.low && y! < SOUGHT.high && z! > SOUGHT.behind;
}

/** How much the light of Gaussian i changes between open and closed lids, squared. */
function changeByBlinking(head: BakedHead, info: HeadInfo): (i: number) => number {
  const open = Float32Array.from(info.idle_expression);
  const closed = open.slice();
  for (const lid of blinkIndices(info)) closed[lid] = 1;
  const [before, after] = [open, closed].map((expression) => {
    const out = new Float32Array(head.rank);
    coefficients(head.network, expression, out);
    return out;
  });
  return (i) => {
    const [a, b] = [light(head, before!, i), light(head, after!, i)];
    return a.reduce((sum, value, channel) => sum + (value - b[channel]!) ** 2, 0);
  };
}

/** What Gaussian i shows: red, green and blue times its opacity, and its opacity. */
function light({ count, meanLogits, basis, basisScale }: BakedHead, coefficients: Float32Array, i: number): number[] {
  const values = [0, 1, 2, 3].map((channel) => {
    const blend = coefficients.reduce((sum, c, k) => sum + c * basis[4 * (count * k + i) + channel]!, 0);
    return 1 / (1 + Math.exp(-(meanLogits[4 * i + channel]! + basisScale[i]! * blend)));
  });
  const opacity = values[3]!;
  return [values[0]! * opacity, values[1]! * opacity, values[2]! * opacity, opacity];
}

/** The value at which half of the weight lies on either side. */
function weightedMedian(pairs: [value: number, weight: number][]): number {
  const sorted = pairs.toSorted((a, b) => a[0] - b[0]);
  const half = sorted.reduce((sum, [, weight]) => sum + weight, 0) / 2;
  let sum = 0;
  return sorted.find(([, weight]) => (sum += weight) >= half)![0];
}
