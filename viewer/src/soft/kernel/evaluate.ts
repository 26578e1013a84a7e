import { HALF, ONE, TWO } from './numbers.ts';
import { approach, splat } from './project.ts';
import { heldPowerOfTwo, sigmoid } from './vectors.ts';

/**
 * Evaluates the Gaussians of each kind of source for a moment, and projects those that may be seen.
 *
 * `view` is (3,4) f32, camera from the source's space; rows are what `source.ts` describes.
 */

const STILL: usize = 64;
const HEAD: usize = 64; // and 4 bytes for each basis vector and displacement
const WINDOW: usize = 64; // and 8 bytes for each basis vector
const SKINNED: usize = 96; // and 8 bytes for each shape
const LEAST_SCALE: f32 = 1e-6; // m
const TABLE_ROW: usize = 64; // bytes of a joint: (3,4) matrix, quaternion wxyz
const LOG2_E: f32 = 1.4426950408889634;

// From this Gaussian of a source on, opacities are multiplied by a share; before it, sizes by a factor.
let late: i32 = 0;
let lateShare: f32 = 1;
let firstWide: f32 = 1;

/**
 * Lets the Gaussians of the next source, a head or a skinned body, appear from number `first` on with
 * a share of their opacity; those before are wider by a factor.
 */
export function fade(first: i32, share: f32, wide: f32): void {
  late = first;
  lateShare = share;
  firstWide = wide;
}

/** What stands still: centre, rotation, scales, colour and opacity. */
export function addStill(view: usize, rows: usize, count: i32): void {
  const end = rows + STILL * <usize>count;
  for (let at = rows; at < end; at += STILL) {
    const s0 = load<f32>(at, 28);
    const s1 = load<f32>(at, 32);
    const s2 = load<f32>(at, 36);
    if (!approach(view, load<f32>(at, 0), load<f32>(at, 4), load<f32>(at, 8), max(s0, max(s1, s2)))) continue;
    const record = splat(view, load<f32>(at, 12), load<f32>(at, 16), load<f32>(at, 20), load<f32>(at, 24), s0, s1, s2, load<f32>(at, 52));
    if (record) colour(record, v128.load(at, 40));
  }
}

// Where the Gaussian of a head that was bent last is, and how it is turned.
let atX: f32 = 0;
let atY: f32 = 0;
let atZ: f32 = 0;
let turnW: f32 = 1;
let turnX: f32 = 0;
let turnY: f32 = 0;
let turnZ: f32 = 0;

/** Moves a Gaussian of a head that was taken by its share of the shoulders' motion. */
function bend(at: usize, motion: usize, share: f32): void {
  const w = load<f32>(motion);
  const i = load<f32>(motion, 4);
  const j = load<f32>(motion, 8);
  const k = load<f32>(motion, 12);
  const x = atX;
  const y = atY;
  const z = atZ;
  const ax = j * z - k * y + w * x;
  const ay = k * x - i * z + w * y;
  const az = i * y - j * x + w * z;
  atX = x + share * (TWO * (j * az - k * ay) + load<f32>(motion, 16));
  atY = y + share * (TWO * (k * ax - i * az) + load<f32>(motion, 20));
  atZ = z + share * (TWO * (i * ay - j * ax) + load<f32>(motion, 24));
  const bw = ONE + share * (w - ONE);
  const bx = share * i;
  const by = share * j;
  const bz = share * k;
  const qw = load<f32>(at, 12);
  const qx = load<f32>(at, 16);
  const qy = load<f32>(at, 20);
  const qz = load<f32>(at, 24);
  turnW = bw * qw - bx * qx - by * qy - bz * qz;
  turnX = bw * qx + bx * qw + by * qz - bz * qy;
  turnY = bw * qy - bx * qz + by * qw + bz * qx;
  turnZ = bw * qz + bx * qy - by * qx + bz * qw;
}

/** Takes a Gaussian of a head as it is. */
// @ts-ignore: decorator
@inline
function take(at: usize): void {
  atX = load<f32>(at, 0);
  atY = load<f32>(at, 4);
  atZ = load<f32>(at, 8);
  turnW = load<f32>(at, 12);
  turnX = load<f32>(at, 16);
  turnY = load<f32>(at, 20);
  turnZ = load<f32>(at, 24);
}

/** Eight-bit numbers at an address, as floating-point ones. */
// @ts-ignore: decorator
@inline
function four(at: usize): v128 {
  return f32x4.convert_i32x4_s(i32x4.extend_low_i16x8_s(i16x8.extend_low_i8x16_s(v128.load32_zero(at))));
}

/** Moves a Gaussian of a head that was taken by displacements at an address, so many metres per unit. */
function displace(at: usize, steps: usize, moves: i32): void {
  let sum = f32x4.splat(0);
  for (let m: usize = 0; m < <usize>moves; m++) {
    sum = f32x4.add(sum, f32x4.mul(v128.load32_splat(steps + (m << 2)), four(at + (m << 2))));
  }
  atX += f32x4.extract_lane(sum, 0);
  atY += f32x4.extract_lane(sum, 1);
  atZ += f32x4.extract_lane(sum, 2);
}

/**
 * A head: logits = mean + scale · Σ c·U; colour, opacity = sigmoid(logits). `values` are the
 * coefficients, the steps of the displacements, and the motion of the shoulders.
 */
export function addHead(view: usize, rows: usize, count: i32, values: usize, rank: i32, moves: i32): void {
  const moving = 4 * <usize>rank; // bytes before displacements, and before their steps
  const stride = HEAD + moving + 4 * <usize>moves;
  const motion = values + moving + 4 * <usize>moves;
  const end = rows + stride * <usize>count;
  const fading = rows + stride * <usize>min(late, count);
  for (let at = rows; at < end; at += stride) {
    const wide = at < fading ? firstWide : ONE;
    const s0 = wide * load<f32>(at, 28);
    const s1 = wide * load<f32>(at, 32);
    const s2 = wide * load<f32>(at, 36);
    const share = load<f32>(at, 60);
    take(at);
    if (moves > 0) displace(at + HEAD + moving, values + moving, moves);
    if (share > 0) bend(at, motion, share);
    if (!approach(view, atX, atY, atZ, max(s0, max(s1, s2)))) continue;
    let blend = f32x4.splat(0);
    for (let k: usize = 0; k < <usize>rank; k++) {
      blend = f32x4.add(blend, f32x4.mul(v128.load32_splat(values + (k << 2)), four(at + HEAD + (k << 2))));
    }
    const light = sigmoid(f32x4.add(v128.load(at, 44), f32x4.mul(v128.load32_splat(at, 40), blend)));
    const opacity: f32 = f32x4.extract_lane(light, 3) * (at < fading ? ONE : lateShare);
    const record = splat(view, turnW, turnX, turnY, turnZ, s0, s1, s2, opacity);
    if (record) colour(record, light);
  }
}

/** A window of a body: `values` are a row of coefficients for each cluster, P of positions, R of rotations, L of scales. */
export function addWindow(view: usize, rows: usize, count: i32, values: usize, positions: i32, rotations: i32, scales: i32, row: i32): void {
  const vectors = positions + rotations + scales;
  const stride = WINDOW + 8 * <usize>vectors;
  const end = rows + stride * <usize>count;
  for (let at = rows; at < end; at += stride) {
    let given = values + 4 * <usize>(load<u32>(at, 56) * row);
    let basis = at + WINDOW;
    const centre = moved(v128.load(at, 0), basis, given, positions);
    basis += 8 * <usize>positions;
    given += 4 * <usize>positions;
    const turn = moved(v128.load(at, 12), basis, given, rotations);
    basis += 8 * <usize>rotations;
    given += 4 * <usize>rotations;
    const size = f32x4.max(moved(v128.load(at, 28), basis, given, scales), f32x4.splat(LEAST_SCALE));
    const s0 = f32x4.extract_lane(size, 0);
    const s1 = f32x4.extract_lane(size, 1);
    const s2 = f32x4.extract_lane(size, 2);
    if (!approach(view, f32x4.extract_lane(centre, 0), f32x4.extract_lane(centre, 1), f32x4.extract_lane(centre, 2), max(s0, max(s1, s2)))) continue;
    const record = splatTurned(view, turn, s0, s1, s2, load<f32>(at, 52));
    if (record) colour(record, v128.load(at, 40));
  }
}

/** A vector plus Σ coefficient · basis vector of 16-bit numbers. */
// @ts-ignore: decorator
@inline
function moved(start: v128, basis: usize, values: usize, count: i32): v128 {
  let sum = start;
  for (let k: usize = 0; k < <usize>count; k++) {
    const vector = f32x4.convert_i32x4_s(v128.load16x4_s(basis + (k << 3)));
    sum = f32x4.add(sum, f32x4.mul(v128.load32_splat(values + (k << 2)), vector));
  }
  return sum;
}

// Where a skinned body's values begin, bytes: see `source.ts`.
const LIGHT: usize = 0;
const LAMP: usize = 8 * 16;
const RESIDUAL: usize = LAMP + 5 * 16;
const TABLE: usize = RESIDUAL + 8 * 4;

/** A body on a skeleton. */
export function addSkinned(view: usize, rows: usize, count: i32, values: usize, shapes: i32, joints: i32, side: i32): void {
  const stride = SKINNED + 8 * <usize>shapes;
  const end = rows + stride * <usize>count;
  const fading = rows + stride * <usize>min(late, count);
  const table = values + TABLE;
  const map = table + TABLE_ROW * <usize>joints;
  for (let at = rows; at < end; at += stride) {
    let x = f32x4.splat(0);
    let y = f32x4.splat(0);
    let z = f32x4.splat(0);
    let turn = f32x4.splat(0);
    for (let k: usize = 0; k < 4; k++) {
      const byte = load<u8>(at + k, 88);
      if (byte == 0) continue;
      const weight = f32x4.splat(<f32>byte * (ONE / 255.0));
      const joint = table + TABLE_ROW * <usize>load<u8>(at + k, 84);
      x = f32x4.add(x, f32x4.mul(weight, v128.load(joint, 0)));
      y = f32x4.add(y, f32x4.mul(weight, v128.load(joint, 16)));
      z = f32x4.add(z, f32x4.mul(weight, v128.load(joint, 32)));
      turn = f32x4.add(turn, f32x4.mul(weight, v128.load(joint, 48)));
    }
    let shift = f32x4.splat(0);
    let tint = f32x4.splat(0);
    for (let k: usize = 0; k < <usize>shapes; k++) {
      const words = v128.load8x8_s(at + SKINNED + (k << 3));
      const much = v128.load32_splat(values + (k << 2), RESIDUAL);
      shift = f32x4.add(shift, f32x4.mul(much, f32x4.convert_i32x4_s(i32x4.extend_low_i16x8_s(words))));
      tint = f32x4.add(tint, f32x4.mul(much, f32x4.convert_i32x4_s(i32x4.extend_high_i16x8_s(words))));
    }
    const rest = f32x4.replace_lane(f32x4.add(v128.load(at, 0), f32x4.mul(v128.load32_splat(at, 76), shift)), 3, 1);
    const cx = sum(f32x4.mul(x, rest));
    const cy = sum(f32x4.mul(y, rest));
    const cz = sum(f32x4.mul(z, rest));
    const wide = at < fading ? firstWide : ONE;
    const s0 = wide * load<f32>(at, 28);
    const s1 = wide * load<f32>(at, 32);
    const s2 = wide * load<f32>(at, 36);
    if (!approach(view, cx, cy, cz, max(s0, max(s1, s2)))) continue;
    const record = splatTurned(view, product(turn, v128.load(at, 12)), s0, s1, s2, load<f32>(at, 52) * (at < fading ? ONE : lateShare));
    if (!record) continue;
    const facing = f32x4.replace_lane(v128.load(at, 60), 3, 0);
    let nx = sum(f32x4.mul(x, facing));
    let ny = sum(f32x4.mul(y, facing));
    let nz = sum(f32x4.mul(z, facing));
    const long = ONE / sqrt<f32>(max(nx * nx + ny * ny + nz * nz, <f32>1e-12));
    nx *= long;
    ny *= long;
    nz *= long;
    const logits = f32x4.add(f32x4.add(v128.load(at, 40), f32x4.mul(v128.load32_splat(at, 80), tint)), harmonics(values + LIGHT, nx, ny, nz));
    const shade = heldPowerOfTwo(f32x4.mul(logits, f32x4.splat(-LOG2_E)));
    const bright = side ? f32x4.add(f32x4.splat(1), lamp(values + LAMP, map, side, cx, cy, cz, nx, ny, nz)) : f32x4.splat(1);
    // sigmoid(logits + log(bright)), without the logarithm
    colour(record, f32x4.div(bright, f32x4.add(bright, shade)));
  }
}

// @ts-ignore: decorator
@inline
function colour(record: usize, light: v128): void {
  store<f32>(record, f32x4.extract_lane(light, 0), 24);
  store<f32>(record, f32x4.extract_lane(light, 1), 28);
  store<f32>(record, f32x4.extract_lane(light, 2), 32);
}

// @ts-ignore: decorator
@inline
function splatTurned(view: usize, turn: v128, s0: f32, s1: f32, s2: f32, opacity: f32): usize {
  return splat(
    view,
    f32x4.extract_lane(turn, 0),
    f32x4.extract_lane(turn, 1),
    f32x4.extract_lane(turn, 2),
    f32x4.extract_lane(turn, 3),
    s0,
    s1,
    s2,
    opacity,
  );
}

// @ts-ignore: decorator
@inline
function sum(a: v128): f32 {
  return f32x4.extract_lane(a, 0) + f32x4.extract_lane(a, 1) + f32x4.extract_lane(a, 2) + f32x4.extract_lane(a, 3);
}

/** Product of quaternions wxyz. */
// @ts-ignore: decorator
@inline
function product(a: v128, b: v128): v128 {
  const w = f32x4.mul(f32x4.splat(f32x4.extract_lane(a, 0)), b);
  const x = f32x4.mul(f32x4.splat(f32x4.extract_lane(a, 1)), v128.shuffle<f32>(b, b, 1, 0, 3, 2));
  const y = f32x4.mul(f32x4.splat(f32x4.extract_lane(a, 2)), v128.shuffle<f32>(b, b, 2, 3, 0, 1));
  const z = f32x4.mul(f32x4.splat(f32x4.extract_lane(a, 3)), v128.shuffle<f32>(b, b, 3, 2, 1, 0));
  const withX = f32x4.add(w, f32x4.mul(x, f32x4(-1, 1, -1, 1)));
  const withY = f32x4.add(withX, f32x4.mul(y, f32x4(-1, 1, 1, -1)));
  return f32x4.add(withY, f32x4.mul(z, f32x4(-1, -1, 1, 1)));
}

/** Real spherical harmonics of degrees 1 and 2; `light` has eight rows of r, g, b. */
function harmonics(light: usize, x: f32, y: f32, z: f32): v128 {
  let lit = f32x4.mul(v128.load(light, 0), f32x4.splat(<f32>-0.4886025119029199 * y));
  lit = f32x4.add(lit, f32x4.mul(v128.load(light, 16), f32x4.splat(<f32>0.4886025119029199 * z)));
  lit = f32x4.add(lit, f32x4.mul(v128.load(light, 32), f32x4.splat(<f32>-0.4886025119029199 * x)));
  lit = f32x4.add(lit, f32x4.mul(v128.load(light, 48), f32x4.splat(<f32>1.0925484305920792 * x * y)));
  lit = f32x4.add(lit, f32x4.mul(v128.load(light, 64), f32x4.splat(<f32>-1.0925484305920792 * y * z)));
  lit = f32x4.add(lit, f32x4.mul(v128.load(light, 80), f32x4.splat(<f32>0.31539156525252005 * (TWO * z * z - x * x - y * y))));
  lit = f32x4.add(lit, f32x4.mul(v128.load(light, 96), f32x4.splat(<f32>-1.0925484305920792 * x * z)));
  return f32x4.add(lit, f32x4.mul(v128.load(light, 112), f32x4.splat(<f32>0.5462742152960396 * (x * x - y * y))));
}

/** The lamp's light on a place: its axes across, up and towards it, its strength, then texel, bias, off, wrap and edge. */
function lamp(at: usize, map: usize, side: i32, x: f32, y: f32, z: f32, nx: f32, ny: f32, nz: f32): v128 {
  const facing = nx * load<f32>(at, 32) + ny * load<f32>(at, 36) + nz * load<f32>(at, 40) + load<f32>(at, 72);
  if (facing <= 0) return f32x4.splat(0);
  const texel = load<f32>(at, 60);
  const off = load<f32>(at, 68);
  const px = x + off * nx;
  const py = y + off * ny;
  const pz = z + off * nz;
  const across: f32 = (px * load<f32>(at, 0) + py * load<f32>(at, 4) + pz * load<f32>(at, 8)) / texel;
  const up: f32 = (px * load<f32>(at, 16) + py * load<f32>(at, 20) + pz * load<f32>(at, 24)) / texel;
  const depth: f32 = px * load<f32>(at, 32) + py * load<f32>(at, 36) + pz * load<f32>(at, 40) + load<f32>(at, 64);
  return f32x4.mul(v128.load(at, 48), f32x4.splat(facing * reach(map, side, across, up, depth, ONE / load<f32>(at, 76))));
}

/** The share of the lamp's light that reaches a place, from the 4 × 4 texels about it. */
function reach(map: usize, side: i32, across: f32, up: f32, depth: f32, steep: f32): f32 {
  const left = floor<f32>(across);
  const low = floor<f32>(up);
  const partX = across - left;
  const partY = up - low;
  let share: f32 = 0;
  for (let down = -1; down < 3; down++) {
    const line = map + <usize>(((<i32>low + down) & (side - 1)) * side * 4);
    const nearY: f32 = ONE - HALF * abs<f32>(partY - <f32>down);
    for (let right = -1; right < 3; right++) {
      const nearest = load<f32>(line + (<usize>((<i32>left + right) & (side - 1)) << 2));
      const nearX: f32 = ONE - HALF * abs<f32>(partX - <f32>right);
      share += nearX * nearY * max(min((depth - nearest) * steep + HALF, ONE), <f32>0);
    }
  }
  return <f32>0.25 * share;
}
