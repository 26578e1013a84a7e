import { HALF, LEVELS_LOG2, ONE, RECORD, TILE_HEIGHT, TILE_WIDTH, TWO } from './numbers.ts';
import { count, depths, records } from './project.ts';

/** Which splats touch which tile of the band, front to back. */

const DIGIT = 11; // bits that one pass of the radix sort takes
const BUCKETS: usize = 1 << DIGIT;
const SLACK: f32 = 0.01; // pixels by which outlines are widened, so that rounding cuts nothing off

/** An entry: the splat's number, and behind it the first and the end row of the tile that it touches. */
const FIRST_SHIFT = 7;
const SPLAT_SHIFT = 13;
const ROWS_MASK: u32 = (1 << 7) - 1;

// @ts-ignore: decorator
@inline
export function splatOf(entry: u32): usize {
  return <usize>(entry >> SPLAT_SHIFT);
}

// @ts-ignore: decorator
@inline
export function firstOf(entry: u32): u32 {
  return (entry >> FIRST_SHIFT) & 63;
}

// @ts-ignore: decorator
@inline
export function endOf(entry: u32): u32 {
  return entry & ROWS_MASK;
}

const starts: usize = memory.data(4 * (1 << DIGIT));

/** Sorts the splats by depth (radix sort, stable); `order` and `spare` hold 8 bytes for each: depth, number. */
export function sortByDepth(order: usize, spare: usize): void {
  for (let i: usize = 0; i < <usize>count; i++) {
    store<u32>(order + (i << 3), load<u32>(depths + (i << 2)));
    store<u32>(order + (i << 3), <u32>i, 4);
  }
  pass(order, spare, 0);
  pass(spare, order, DIGIT);
  pass(order, spare, 2 * DIGIT);
}

function pass(from: usize, to: usize, shift: u32): void {
  memory.fill(starts, 0, 4 * BUCKETS);
  const end = from + (<usize>count << 3);
  const mask: u32 = <u32>BUCKETS - 1;
  for (let at = from; at < end; at += 8) {
    const bucket = starts + (<usize>((load<u32>(at) >> shift) & mask) << 2);
    store<u32>(bucket, load<u32>(bucket) + 1);
  }
  let sum: u32 = 0;
  for (let bucket = starts; bucket < starts + 4 * BUCKETS; bucket += 4) {
    const here = load<u32>(bucket);
    store<u32>(bucket, sum);
    sum += here;
  }
  for (let at = from; at < end; at += 8) {
    const bucket = starts + (<usize>((load<u32>(at) >> shift) & mask) << 2);
    const place = load<u32>(bucket);
    store<u32>(bucket, place + 1);
    store<u64>(to + (<usize>place << 3), load<u64>(at));
  }
}

/** A number rounded down and held between two whole ones, before it is: no integer holds what may come in; `least` for what is no number. */
// @ts-ignore: decorator
@inline
function whole(number: f32, least: i32, most: i32): i32 {
  return number > <f32>least ? (number < <f32>most ? <i32>floor<f32>(number) : most) : least;
}

/**
 * Lists the pairs of tile and entry of all splats, and counts those of each tile.
 *
 * Tiles are numbered down the columns of the band. No splat is listed outside of its box, by which
 * there is room for it: the ellipse of one far off the picture may be larger, as it is rounded.
 *
 * @param order the splats front to back, 8 bytes each: depth, number
 * @param pairs gets 8 bytes each: tile, entry
 * @param most pairs for which there is room
 * @param counts u32 for each tile of the band, written
 * @param all whether all pairs are wanted; else those are left out, farthest ones first, for which there is no room
 * @returns number of the pairs; more than `most` where room is lacking for all
 */
export function listPairs(order: usize, pairs: usize, most: u32, all: bool, counts: usize, firstColumn: i32, endColumn: i32, down: i32): u32 {
  memory.fill(counts, 0, 4 * <usize>((endColumn - firstColumn) * down));
  let number: u32 = 0;
  for (let i: usize = 0; i < <usize>count; i++) {
    const splat = load<u32>(order + (i << 3), 4);
    const record = records + <usize>splat * RECORD;
    const x: f32 = load<f32>(record, 0) - 0.5;
    const y: f32 = load<f32>(record, 4) - 0.5;
    const a = load<f32>(record, 8);
    const b = load<f32>(record, 12);
    // The ellipse p·u² + 2ab·u·v + q·v² ≤ cut.
    const q = load<f32>(record, 16) + b * b;
    const cut = load<f32>(record, 20) + LEVELS_LOG2;
    const reachX = load<f32>(record, 40) + SLACK;
    const tip = -b / a * load<f32>(record, 44); // the u at which v is greatest
    const shear: f32 = -TWO * a * b;
    const discriminant: f32 = -TWO * TWO * a * a * load<f32>(record, 16);
    const room: f32 = TWO * TWO * q * cut;
    const scale: f32 = 0.5 / q;
    const reachY = load<f32>(record, 44) + SLACK;
    const from = whole((x + HALF - reachX) * (ONE / <f32>TILE_WIDTH), firstColumn, endColumn);
    const to = whole((x + HALF + reachX) * (ONE / <f32>TILE_WIDTH), from - 1, endColumn - 1) + 1;
    const upper = whole((y + HALF - reachY) * (ONE / <f32>TILE_HEIGHT), 0, down);
    const lower = whole((y + HALF + reachY) * (ONE / <f32>TILE_HEIGHT), upper - 1, down - 1) + 1;
    if (number + <u32>((to - from) * (lower - upper)) > most) return all ? most + 1 : number;
    const highest = upper * TILE_HEIGHT;
    const lowest = lower * TILE_HEIGHT;
    for (let column = from; column < to; column++) {
      const low = <f32>(column * TILE_WIDTH) - x - SLACK;
      const high = low + <f32>(TILE_WIDTH - 1) + TWO * SLACK;
      const top = min(max(tip, low), high);
      const bottom = min(max(-tip, low), high);
      const underTop = discriminant * top * top + room;
      const underBottom = discriminant * bottom * bottom + room;
      if (underTop < 0 || underBottom < 0) continue;
      const least = shear * bottom - sqrt<f32>(underBottom);
      const greatest = shear * top + sqrt<f32>(underTop);
      const first = whole(y + scale * least - SLACK, highest - 1, lowest) + 1;
      const end = whole(y + scale * greatest + SLACK, highest - 1, lowest - 1) + 1;
      for (let above = first & ~(TILE_HEIGHT - 1); above < end; above += TILE_HEIGHT) {
        const tile = <usize>((column - firstColumn) * down + above / TILE_HEIGHT);
        const counter = counts + (tile << 2);
        store<u32>(counter, load<u32>(counter) + 1);
        const entry = (splat << SPLAT_SHIFT) | (<u32>max(first - above, 0) << FIRST_SHIFT) | <u32>min(end - above, TILE_HEIGHT);
        const pair = pairs + (<usize>number << 3);
        store<u32>(pair, <u32>tile);
        store<u32>(pair, entry, 4);
        number++;
      }
    }
  }
  return number;
}

/** Sorts pairs into tiles, in the order in which they lie; `counts` becomes where a tile's entries end. */
export function fillTiles(pairs: usize, number: u32, counts: usize, tiles: i32, entries: usize): void {
  let sum: u32 = 0;
  for (let at = counts; at < counts + 4 * <usize>tiles; at += 4) {
    const here = load<u32>(at);
    store<u32>(at, sum);
    sum += here;
  }
  for (let pair = pairs; pair < pairs + (<usize>number << 3); pair += 8) {
    const counter = counts + (<usize>load<u32>(pair) << 2);
    const place = load<u32>(counter);
    store<u32>(counter, place + 1);
    store<u32>(entries + (<usize>place << 2), load<u32>(pair, 4));
  }
}
