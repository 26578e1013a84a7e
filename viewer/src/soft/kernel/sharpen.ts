/** What is shown of a band: a part of it, sharpened so that enlarging it straight between pixels blurs less. */

const PIXEL: usize = 4; // bytes
const TILE_BYTES: usize = 16; // of a row of a tile
const SHIFT = 6; // amounts are 64ths
const HALF: i16 = 32; // of them, which rounds

/**
 * Copies rows of some columns of tiles, each pixel plus an amount of its difference from its neighbours:
 * c + amount / 64 · (4c − above − below − left − right).
 *
 * @param pixels RGBA of a band of `columns` columns of tiles, (height, 4 · columns)
 * @param amount 0 for a plain copy, at most 31
 * @param out RGBA (endRow − firstRow, 4 · (endColumn − firstColumn))
 */
export function take(
  pixels: usize,
  columns: i32,
  height: i32,
  firstColumn: i32,
  endColumn: i32,
  firstRow: i32,
  endRow: i32,
  amount: i32,
  out: usize,
): void {
  const stride = TILE_BYTES * <usize>columns;
  const much = i16x8.splat(<i16>amount);
  const width = TILE_BYTES * <usize>(endColumn - firstColumn);
  for (let row = firstRow; row < endRow; row++) {
    const line = pixels + stride * <usize>row;
    if (amount == 0) {
      memory.copy(out, line + TILE_BYTES * <usize>firstColumn, width);
      out += width;
      continue;
    }
    const above = row > 0 ? line - stride : line;
    const below = row < height - 1 ? line + stride : line;
    for (let column = firstColumn; column < endColumn; column++) {
      const at = TILE_BYTES * <usize>column;
      const here = v128.load(line + at);
      // Beyond the edges the picture goes on as it ends.
      const left = column > 0 ? v128.load(line + at - PIXEL) : v128.shuffle<i32>(here, here, 0, 0, 1, 2);
      const right = column < columns - 1 ? v128.load(line + at + PIXEL) : v128.shuffle<i32>(here, here, 1, 2, 3, 3);
      v128.store(out, sharpened(here, left, right, v128.load(above + at), v128.load(below + at), much));
      out += TILE_BYTES;
    }
  }
}

/** Four pixels; alpha is sharpened as colours are, and stays where it is the same everywhere. */
// @ts-ignore: decorator
@inline
function sharpened(here: v128, left: v128, right: v128, above: v128, below: v128, much: v128): v128 {
  const low = raised(
    i16x8.extend_low_i8x16_u(here),
    i16x8.add(
      i16x8.add(i16x8.extend_low_i8x16_u(left), i16x8.extend_low_i8x16_u(right)),
      i16x8.add(i16x8.extend_low_i8x16_u(above), i16x8.extend_low_i8x16_u(below)),
    ),
    much,
  );
  const high = raised(
    i16x8.extend_high_i8x16_u(here),
    i16x8.add(
      i16x8.add(i16x8.extend_high_i8x16_u(left), i16x8.extend_high_i8x16_u(right)),
      i16x8.add(i16x8.extend_high_i8x16_u(above), i16x8.extend_high_i8x16_u(below)),
    ),
    much,
  );
  return i8x16.narrow_i16x8_u(low, high);
}

// @ts-ignore: decorator
@inline
function raised(here: v128, around: v128, much: v128): v128 {
  const edge = i16x8.mul(i16x8.sub(i16x8.shl(here, 2), around), much); // at most 4 · 255 · 31 = 31,620
  return i16x8.add(here, i16x8.shr_s(i16x8.add(edge, i16x8.splat(HALF)), SHIFT));
}
