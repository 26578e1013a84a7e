import { BLUR, FRUSTUM_MARGIN, LEVELS_LOG2, LOG2_E, MIN_ALPHA, NEAR, ONE, RECORD, TWO } from './numbers.ts';
import { heldPowerOfTwo } from './vectors.ts';

/** 3D Gaussians to splats of the picture (EWA splatting with a low-pass filter). */

// The lens and the band of the picture that is drawn, in pixels.
let fx: f32 = 1;
let fy: f32 = 1;
let cx: f32 = 0;
let cy: f32 = 0;
let left: f32 = 0;
let right: f32 = 0;
let height: f32 = 0;
// Slopes x/z and y/z beyond which the linearisation fails.
let leastX: f32 = 0;
let mostX: f32 = 0;
let leastY: f32 = 0;
let mostY: f32 = 0;

// The Gaussian at hand, in camera space, and its slopes.
let x: f32 = 0;
let y: f32 = 0;
let z: f32 = 1;
let slopeX: f32 = 0;
let slopeY: f32 = 0;

/** Splats of this picture: their records, and their depths as sortable bits. */
export let records: usize = 0;
export let depths: usize = 0;
export let count: i32 = 0;

export function useRoom(toRecords: usize, toDepths: usize): void {
  records = toRecords;
  depths = toDepths;
}

export function begin(newFx: f32, newFy: f32, newCx: f32, newCy: f32, width: f32, newHeight: f32, newLeft: f32, newRight: f32): void {
  fx = newFx;
  fy = newFy;
  cx = newCx;
  cy = newCy;
  height = newHeight;
  left = newLeft;
  right = newRight;
  const marginX: f32 = FRUSTUM_MARGIN * 0.5 * width / fx;
  const marginY: f32 = FRUSTUM_MARGIN * 0.5 * height / fy;
  leastX = -cx / fx - marginX;
  mostX = (width - cx) / fx + marginX;
  leastY = -cy / fy - marginY;
  mostY = (height - cy) / fy + marginY;
  count = 0;
}

/**
 * Takes a Gaussian at hand, and says whether it may touch the band.
 *
 * @param view (3,4) f32 rows, camera from the Gaussian's space
 * @param size largest standard deviation, m
 */
export function approach(view: usize, mx: f32, my: f32, mz: f32, size: f32): bool {
  z = load<f32>(view, 32) * mx + load<f32>(view, 36) * my + load<f32>(view, 40) * mz + load<f32>(view, 44);
  if (!(z >= NEAR)) return false;
  x = load<f32>(view, 0) * mx + load<f32>(view, 4) * my + load<f32>(view, 8) * mz + load<f32>(view, 12);
  y = load<f32>(view, 16) * mx + load<f32>(view, 20) * my + load<f32>(view, 24) * mz + load<f32>(view, 28);
  const over: f32 = 1 / z;
  slopeX = min(max(x * over, leastX), mostX);
  slopeY = min(max(y * over, leastY), mostY);
  const focal: f32 = max(fx, fy) * over * size;
  // An alpha of 1 ends at 3.33 standard deviations.
  const reach: f32 = 3.34 * sqrt<f32>(focal * focal * (ONE + slopeX * slopeX + slopeY * slopeY) + BLUR);
  const u = fx * x * over + cx;
  const v = fy * y * over + cy;
  return u + reach > left && u - reach < right && v + reach > 0 && v - reach < height;
}

/**
 * Projects the Gaussian at hand.
 *
 * The record: centre (2); a, b, c and l of log2(alpha) = l − (a·dx + b·dy)² − c·dy²; colour (3), for
 * the caller to write; the ratio by which the ratio of successive rows shrinks; half sizes (2).
 *
 * @returns its record, 0 where nobody sees it
 */
export function splat(view: usize, w: f32, i: f32, j: f32, k: f32, s0: f32, s1: f32, s2: f32, opacity: f32): usize {
  const over: f32 = 1 / z;
  const j00 = fx * over;
  const j02 = -j00 * slopeX;
  const j11 = fy * over;
  const j12 = -j11 * slopeY;
  const a0 = j00 * load<f32>(view, 0) + j02 * load<f32>(view, 32);
  const a1 = j00 * load<f32>(view, 4) + j02 * load<f32>(view, 36);
  const a2 = j00 * load<f32>(view, 8) + j02 * load<f32>(view, 40);
  const b0 = j11 * load<f32>(view, 16) + j12 * load<f32>(view, 32);
  const b1 = j11 * load<f32>(view, 20) + j12 * load<f32>(view, 36);
  const b2 = j11 * load<f32>(view, 24) + j12 * load<f32>(view, 40);
  const twice: f32 = 2 / (w * w + i * i + j * j + k * k);
  const r00 = (ONE - twice * (j * j + k * k)) * s0;
  const r01 = twice * (i * j - w * k) * s1;
  const r02 = twice * (i * k + w * j) * s2;
  const r10 = twice * (i * j + w * k) * s0;
  const r11 = (ONE - twice * (i * i + k * k)) * s1;
  const r12 = twice * (j * k - w * i) * s2;
  const r20 = twice * (i * k - w * j) * s0;
  const r21 = twice * (j * k + w * i) * s1;
  const r22 = (ONE - twice * (i * i + j * j)) * s2;
  const p0 = a0 * r00 + a1 * r10 + a2 * r20;
  const p1 = a0 * r01 + a1 * r11 + a2 * r21;
  const p2 = a0 * r02 + a1 * r12 + a2 * r22;
  const q0 = b0 * r00 + b1 * r10 + b2 * r20;
  const q1 = b0 * r01 + b1 * r11 + b2 * r21;
  const q2 = b0 * r02 + b1 * r12 + b2 * r22;
  const xx = p0 * p0 + p1 * p1 + p2 * p2;
  const xy = p0 * q0 + p1 * q1 + p2 * q2;
  const yy = q0 * q0 + q1 * q1 + q2 * q2;
  // The determinant as |p × q|², so that nothing cancels.
  const c0 = p1 * q2 - p2 * q1;
  const c1 = p2 * q0 - p0 * q2;
  const c2 = p0 * q1 - p1 * q0;
  const sharp = c0 * c0 + c1 * c1 + c2 * c2;
  const blurred = sharp + BLUR * (xx + yy) + BLUR * BLUR;
  const alpha = opacity * sqrt<f32>(sharp / blurred);
  if (!(alpha >= MIN_ALPHA)) return 0;
  const top: f32 = Mathf.log2(alpha);
  const reach = sqrt<f32>((TWO / LOG2_E) * (top + LEVELS_LOG2));
  const reachX = reach * sqrt<f32>(xx + BLUR);
  const reachY = reach * sqrt<f32>(yy + BLUR);
  const u = fx * x * over + cx;
  const v = fy * y * over + cy;
  if (u + reachX <= left || u - reachX >= right || v + reachY <= 0 || v - reachY >= height) return 0;
  const half: f32 = 0.5 * LOG2_E / blurred;
  const a = sqrt<f32>(half * (yy + BLUR));
  const b = -half * xy / a;
  const down = half * (xx + BLUR);
  const record = records + <usize>count * RECORD;
  store<f32>(record, u, 0);
  store<f32>(record, v, 4);
  store<f32>(record, a, 8);
  store<f32>(record, b, 12);
  store<f32>(record, half * 0.5 * LOG2_E / (a * a), 16); // down − b², without the difference of large numbers
  store<f32>(record, top, 20);
  store<f32>(record, f32x4.extract_lane(heldPowerOfTwo(f32x4.splat(-2 * down)), 0), 36);
  store<f32>(record, reachX, 40);
  store<f32>(record, reachY, 44);
  store<f32>(depths + (<usize>count << 2), z);
  count++;
  return record;
}
