/**
 * Draws the spheres under the skin as distant lamps see them, and looks up whose light is hidden.
 *
 * All addresses are bytes of this module's memory. The map has `side` rows of `side` texels and of
 * four more, which are the first ones again, so that vectors of four need not be split at its edge.
 */

const FAR: f32 = -1e9; // where no sphere lies
const ONE: f32 = 1;
const HALF: f32 = 0.5;

let side: i32 = 0;
let stride: usize = 0; // bytes from row to row
let map: usize = 0;
let reach: f64 = 0; // the spheres' radius, texels
let texel: f64 = 0; // m
let bias: f64 = 0; // m
let steep: f32 = 0; // share of light per metre
let out: f64 = 0; // m from a sphere's centre to where its light is looked for

/** Room for `bytes`, for ever. */
export function reserve(bytes: usize): usize {
  return (heap.alloc(bytes + 15) + 15) & ~15;
}

/**
 * Makes room for the map.
 *
 * @returns its address
 */
export function prepare(newSide: i32, newTexel: f64, radius: f64, newBias: f64, edge: f64, newOut: f64): usize {
  side = newSide;
  stride = <usize>(side + 4) << 2;
  map = reserve(stride * <usize>side);
  texel = newTexel;
  reach = radius / texel;
  bias = newBias;
  steep = <f32>(1 / edge);
  out = newOut;
  return map;
}

/** Draws the spheres (count,3) f64 as they are seen by axes (3,3) f64: across, up and towards the lamp. */
export function draw(axes: usize, centres: usize, count: i32): void {
  for (let at = map, end = map + stride * <usize>side; at < end; at += 16) v128.store(at, f32x4.splat(FAR));
  for (let at = centres, end = centres + 24 * <usize>count; at < end; at += 24) {
    const x = load<f64>(at, 0);
    const y = load<f64>(at, 8);
    const z = load<f64>(at, 16);
    sphere(along(axes, x, y, z) / texel, along(axes + 24, x, y, z) / texel, along(axes + 48, x, y, z));
  }
  for (let row = map, end = map + stride * <usize>side; row < end; row += stride) {
    const more = row + stride - 16;
    const first = f32x4.max(v128.load(row), v128.load(more));
    v128.store(row, first);
    v128.store(more, first);
  }
}

// @ts-ignore: decorator
@inline
function along(axis: usize, x: f64, y: f64, z: f64): f64 {
  return load<f64>(axis, 0) * x + load<f64>(axis, 8) * y + load<f64>(axis, 16) * z;
}

/** Draws a sphere whose centre is at a column and row of the map, and so many metres towards the lamp; it is three or four texels wide. */
// @ts-ignore: decorator
@inline
function sphere(x: f64, y: f64, towards: f64): void {
  const left = ceil<f64>(x - reach);
  const low = ceil<f64>(y - reach);
  const column = map + (<usize>(<i32>left & (side - 1)) << 2);
  const first = f64x2.sub(f64x2(left, left + 1), f64x2.splat(x));
  const second = f64x2.sub(f64x2(left + 2, left + 3), f64x2.splat(x));
  const wide = f64x2.splat(reach * reach);
  const firstLeft = f64x2.sub(wide, f64x2.mul(first, first));
  const secondLeft = f64x2.sub(wide, f64x2.mul(second, second));
  const line = <i32>low;
  chord(column, line, low - y, firstLeft, secondLeft, towards);
  chord(column, line + 1, low + 1 - y, firstLeft, secondLeft, towards);
  chord(column, line + 2, low + 2 - y, firstLeft, secondLeft, towards);
  if (low + 3 <= y + reach) chord(column, line + 3, low + 3 - y, firstLeft, secondLeft, towards);
}

/** Draws a row of a sphere, so many texels above its centre; what is left of its squared radius is given for four columns. */
// @ts-ignore: decorator
@inline
function chord(column: usize, row: i32, up: f64, first: v128, second: v128, towards: f64): void {
  const place = column + stride * <usize>(row & (side - 1));
  const square = f64x2.splat(up * up);
  const depths = v128.shuffle<f32>(depth(f64x2.sub(first, square), towards), depth(f64x2.sub(second, square), towards), 0, 1, 4, 5);
  v128.store(place, f32x4.pmax(v128.load(place), depths)); // what is no number stays behind
}

/** How far a sphere reaches where its squared radius leaves so much, texels²: two f32, no numbers outside of it. */
// @ts-ignore: decorator
@inline
function depth(left: v128, towards: f64): v128 {
  return f32x4.demote_f64x2_zero(f64x2.add(f64x2.splat(towards), f64x2.mul(f64x2.splat(texel), f64x2.sqrt(left))));
}

/**
 * Adds the light from where the map was drawn, on each sphere's skin, to `open` (count,) f64, and what it
 * would be without the others to `whole`; `normals` (count,3) f64 are 1 long.
 */
export function gather(axes: usize, centres: usize, normals: usize, count: i32, open: usize, whole: usize): void {
  for (let i: usize = 0; i < <usize>count; i++) {
    const normal = normals + 24 * i;
    const nx = load<f64>(normal, 0);
    const ny = load<f64>(normal, 8);
    const nz = load<f64>(normal, 16);
    const cosine = along(axes + 48, nx, ny, nz);
    if (!(cosine > 0)) continue;
    const centre = centres + 24 * i;
    const x = load<f64>(centre, 0) + out * nx;
    const y = load<f64>(centre, 8) + out * ny;
    const z = load<f64>(centre, 16) + out * nz;
    const share = lit(along(axes, x, y, z) / texel, along(axes + 24, x, y, z) / texel, along(axes + 48, x, y, z) + bias);
    const at = i << 3;
    store<f64>(open + at, load<f64>(open + at) + cosine * share);
    store<f64>(whole + at, load<f64>(whole + at) + cosine);
  }
}

/** The share of the light that reaches a place of the map, from the 4 × 4 texels about it. */
// @ts-ignore: decorator
@inline
function lit(across: f64, up: f64, towards: f64): f64 {
  const left = floor<f64>(across);
  const low = floor<f64>(up);
  const column = map + (<usize>((<i32>left - 1) & (side - 1)) << 2);
  const line = <i32>low;
  const above = <f32>(up - low);
  const deep = f32x4.splat(<f32>towards);
  let share = row(column, line - 1, HALF - HALF * above, deep);
  share = f32x4.add(share, row(column, line, ONE - HALF * above, deep));
  share = f32x4.add(share, row(column, line + 1, HALF + HALF * above, deep));
  share = f32x4.add(share, row(column, line + 2, HALF * above, deep));
  const aside = f32x4.abs(f32x4.sub(f32x4.splat(<f32>(across - left)), f32x4(-1, 0, 1, 2)));
  const by = f32x4.mul(share, f32x4.sub(f32x4.splat(1), f32x4.mul(f32x4.splat(HALF), aside)));
  return <f64>(<f32>0.25 * (f32x4.extract_lane(by, 0) + f32x4.extract_lane(by, 1) + f32x4.extract_lane(by, 2) + f32x4.extract_lane(by, 3)));
}

/** The light that passes four texels of a row, which counts so much. */
// @ts-ignore: decorator
@inline
function row(column: usize, line: i32, near: f32, deep: v128): v128 {
  const nearest = v128.load(column + stride * <usize>(line & (side - 1)));
  const before = f32x4.add(f32x4.mul(f32x4.sub(deep, nearest), f32x4.splat(steep)), f32x4.splat(HALF));
  return f32x4.mul(f32x4.splat(near), f32x4.pmax(f32x4.splat(0), f32x4.pmin(f32x4.splat(1), before)));
}
