import { renew } from './keep.ts';
import { TILE_HEIGHT } from './numbers.ts';

/** What is behind everybody: the pixels of a band, from colours that are given at every so many pixels. */

const COLOUR: usize = 12; // bytes

/**
 * Writes the background of a band, straight between the colours that are given; noise of half a level
 * hides the steps between them. Tiles of which a pixel changes are drawn anew with the next picture.
 *
 * @param colours f32 (rows, columns, 3) display values, of the whole picture
 * @param step pixels from one of them to the next, a multiple of a tile's width
 * @param pixels RGBA of the band, rows of `stride` bytes; holds the background of before
 */
export function spreadCloth(
  colours: usize,
  columns: i32,
  step: i32,
  firstColumn: i32,
  endColumn: i32,
  height: i32,
  pixels: usize,
  stride: usize,
): void {
  let tile: usize = 0;
  for (let column = firstColumn; column < endColumn; column++) {
    for (let top = 0; top < height; top += TILE_HEIGHT, tile++) {
      const place = pixels + <usize>top * stride + (<usize>(column - firstColumn) << 4);
      if (spreadTile(colours, columns, step, column << 2, top, min(height, top + TILE_HEIGHT), place, stride)) renew(tile);
    }
  }
}

/** Whether a pixel of the tile changed. */
function spreadTile(colours: usize, columns: i32, step: i32, x: i32, top: i32, bottom: i32, pixels: usize, stride: usize): bool {
  const line = COLOUR * <usize>columns;
  const over: f32 = <f32>1 / <f32>step;
  const aside = f32x4.mul(f32x4.splat(over), f32x4.add(f32x4.splat(<f32>(x % step)), f32x4(0, 1, 2, 3)));
  const across = f32x4.mul(f32x4.splat(0.06711056), f32x4.add(f32x4.splat(<f32>x), f32x4(0, 1, 2, 3)));
  const levels = f32x4.splat(255);
  let changed = i32x4.splat(0);
  for (let y = top; y < bottom; y++, pixels += stride) {
    const above = colours + line * <usize>(y / step) + COLOUR * <usize>(x / step);
    const down = f32x4.splat(<f32>(y % step) * over);
    const left = f32x4.mul(levels, between(v128.load(above), v128.load(above + line), down));
    const right = f32x4.mul(levels, between(v128.load(above, COLOUR), v128.load(above + line, COLOUR), down));
    const noise = fraction(f32x4.mul(f32x4.splat(52.9829189), fraction(f32x4.add(across, f32x4.splat(<f32>0.00583715 * <f32>y)))));
    const red = level(splatLane0(left), splatLane0(right), aside, noise);
    const green = level(splatLane1(left), splatLane1(right), aside, noise);
    const blue = level(splatLane2(left), splatLane2(right), aside, noise);
    const pixel = v128.or(
      v128.or(red, i32x4.shl(green, 8)),
      v128.or(i32x4.shl(blue, 16), i32x4.splat(0xff000000)),
    );
    changed = v128.or(changed, v128.xor(pixel, v128.load(pixels)));
    v128.store(pixels, pixel);
  }
  return v128.any_true(changed);
}

// @ts-ignore: decorator
@inline
function between(from: v128, to: v128, share: v128): v128 {
  return f32x4.add(from, f32x4.mul(share, f32x4.sub(to, from)));
}

// @ts-ignore: decorator
@inline
function fraction(value: v128): v128 {
  return f32x4.sub(value, f32x4.floor(value));
}

/** The noise, from 0 to 1, is half a level less and half a level more, to round. */
// @ts-ignore: decorator
@inline
function level(left: v128, right: v128, aside: v128, noise: v128): v128 {
  return i32x4.min_u(i32x4.trunc_sat_f32x4_u(f32x4.add(between(left, right, aside), noise)), i32x4.splat(255));
}

// @ts-ignore: decorator
@inline
function splatLane0(value: v128): v128 {
  return v128.shuffle<f32>(value, value, 0, 0, 0, 0);
}

// @ts-ignore: decorator
@inline
function splatLane1(value: v128): v128 {
  return v128.shuffle<f32>(value, value, 1, 1, 1, 1);
}

// @ts-ignore: decorator
@inline
function splatLane2(value: v128): v128 {
  return v128.shuffle<f32>(value, value, 2, 2, 2, 2);
}
