import { MAX_ALPHA, MIN_ALPHA, MIN_TRANSMITTANCE, ONE, RECORD, ROW, TWO } from './numbers.ts';
import { records } from './project.ts';
import { endOf, firstOf, splatOf } from './tiles.ts';
import { bytesOf, heldPowerOfTwo } from './vectors.ts';

/** Alpha compositing of a tile, splats front to back until every pixel is opaque. */

const CHECK = 8; // splats after which finished rows are left out
const TILE: usize = 64 * ROW;
const state: usize = memory.data(64 * 64, 16);

/** Makes the tile empty: all light comes through. */
function clear(): void {
  const one = f32x4.splat(1);
  const zero = f32x4.splat(0);
  for (let row = state; row < state + TILE; row += ROW) {
    v128.store(row, one, 0);
    v128.store(row, zero, 16);
    v128.store(row, zero, 32);
    v128.store(row, zero, 48);
  }
}

// Rows of the tile outside of which all pixels are finished, as places in the state.
let openFirst: usize = state;
let openEnd: usize = state;

/** Leaves out finished rows above and below; whether none is left. */
function finished(): bool {
  const closed = f32x4.splat(0);
  while (openFirst < openEnd && !v128.any_true(f32x4.gt(v128.load(openFirst), closed))) openFirst += ROW;
  while (openFirst < openEnd && !v128.any_true(f32x4.gt(v128.load(openEnd - ROW), closed))) openEnd -= ROW;
  return openFirst == openEnd;
}

/**
 * Composites one splat into some rows of the tile.
 *
 * From row to row, alpha is multiplied by a ratio and the ratio by a constant: both follow from the
 * logarithm being quadratic. A finished pixel's transmittance is negative, and stays.
 */
function blend(entry: u32, left: f32, above: f32): void {
  const record = records + splatOf(entry) * RECORD;
  const begin = max(state + <usize>firstOf(entry) * ROW, openFirst);
  const end = min(state + <usize>endOf(entry) * ROW, openEnd);
  if (begin >= end) return;
  const first = (begin - state) / ROW;
  const dx = f32x4.add(f32x4.splat(left - load<f32>(record, 0)), f32x4(0.5, 1.5, 2.5, 3.5));
  const dy: f32 = above + <f32>first + 0.5 - load<f32>(record, 4);
  const a = load<f32>(record, 8);
  const b = load<f32>(record, 12);
  const c = load<f32>(record, 16);
  const across = f32x4.add(f32x4.mul(f32x4.splat(a), dx), f32x4.splat(b * dy));
  let alpha = heldPowerOfTwo(f32x4.sub(f32x4.splat(load<f32>(record, 20) - c * dy * dy), f32x4.mul(across, across)));
  const rise = f32x4.add(f32x4.mul(f32x4.splat(-TWO * a * b), dx), f32x4.splat(-(c + b * b) * (TWO * dy + ONE)));
  let ratio = heldPowerOfTwo(rise);
  const shrinking = v128.load32_splat(record, 36);
  const red = v128.load32_splat(record, 24);
  const green = v128.load32_splat(record, 28);
  const blue = v128.load32_splat(record, 32);
  const most = f32x4.splat(MAX_ALPHA);
  const least = f32x4.splat(MIN_ALPHA);
  const dark = f32x4.splat(MIN_TRANSMITTANCE);
  const sign = i32x4.splat(i32.MIN_VALUE);
  for (let row = begin; row < end; row += ROW) {
    const before = v128.load(row, 0);
    const weight = v128.and(f32x4.mul(f32x4.pmin(alpha, most), before), f32x4.ge(alpha, least));
    const after = f32x4.sub(before, weight);
    const open = f32x4.gt(after, dark);
    const seen = v128.and(weight, open);
    v128.store(row, v128.or(f32x4.sub(before, seen), v128.andnot(sign, open)), 0);
    v128.store(row, f32x4.add(v128.load(row, 16), f32x4.mul(seen, red)), 16);
    v128.store(row, f32x4.add(v128.load(row, 32), f32x4.mul(seen, green)), 32);
    v128.store(row, f32x4.add(v128.load(row, 48), f32x4.mul(seen, blue)), 48);
    alpha = f32x4.mul(alpha, ratio);
    ratio = f32x4.mul(ratio, shrinking);
  }
}

/** Writes the tile over what is behind it, which is opaque or not there at all; colours are not multiplied by alpha. */
function write(rows: usize, behind: usize, pixels: usize, stride: usize): void {
  for (let row: usize = 0; row < rows; row++) {
    const from = state + row * ROW;
    const light = f32x4.abs(v128.load(from, 0));
    const far = v128.load(behind + row * stride);
    const level = f32x4.mul(light, f32x4.splat(1.0 / 255.0));
    const clear = i32x4.eq(i32x4.shr_u(far, 24), i32x4.splat(0));
    const alpha = f32x4.sub(f32x4.splat(1), v128.and(light, clear));
    const share = f32x4.div(f32x4.splat(1), f32x4.max(alpha, f32x4.splat(MIN_ALPHA)));
    const red = f32x4.add(v128.load(from, 16), f32x4.mul(level, f32x4.convert_i32x4_u(v128.and(far, i32x4.splat(255)))));
    const green = f32x4.add(v128.load(from, 32), f32x4.mul(level, f32x4.convert_i32x4_u(v128.and(i32x4.shr_u(far, 8), i32x4.splat(255)))));
    const blue = f32x4.add(v128.load(from, 48), f32x4.mul(level, f32x4.convert_i32x4_u(v128.and(i32x4.shr_u(far, 16), i32x4.splat(255)))));
    v128.store(pixels + row * stride, bytesOf(f32x4.mul(red, share), f32x4.mul(green, share), f32x4.mul(blue, share), alpha));
  }
}

/** Shows what is behind a tile in which nothing is. */
function writeEmpty(rows: usize, behind: usize, pixels: usize, stride: usize): void {
  for (let row: usize = 0; row < rows; row++) v128.store(pixels + row * stride, v128.load(behind + row * stride));
}

/** Draws one tile from its entries; `behind` and `pixels` are RGBA of its first pixel. */
export function drawTile(entries: usize, end: usize, left: i32, above: i32, rows: usize, behind: usize, pixels: usize, stride: usize): void {
  if (entries == end) {
    writeEmpty(rows, behind, pixels, stride);
    return;
  }
  clear();
  openFirst = state;
  openEnd = state + rows * ROW;
  let until = min(end, entries + 4 * CHECK);
  for (let entry = entries; entry < end; entry = until, until = min(end, until + 4 * CHECK)) {
    for (; entry < until; entry += 4) blend(load<u32>(entry), <f32>left, <f32>above);
    if (finished()) break;
  }
  write(rows, behind, pixels, stride);
}
