import { drawTile } from './blend.ts';
import { spreadCloth } from './cloth.ts';
import { addHead, addSkinned, addStill, addWindow, fade } from './evaluate.ts';
import { digestSplats, forget, keeps, useRoomToKeep } from './keep.ts';
import { RECORD, TILE_HEIGHT, TILE_WIDTH } from './numbers.ts';
import { begin as beginProjection, count, useRoom } from './project.ts';
import { take } from './sharpen.ts';
import { fillTiles, listPairs, sortByDepth } from './tiles.ts';

/** What the page calls. All addresses are bytes of this module's memory. */

export { addHead, addSkinned, addStill, addWindow, fade, take };

/** Room for `bytes`, for ever, and for one vector behind them, which may be read beyond the last number. */
export function reserve(bytes: usize): usize {
  return (heap.alloc(bytes + 31) + 15) & ~15;
}

let order: usize = 0;
let spare: usize = 0;
let pairs: usize = 0;
let entries: usize = 0;
let counts: usize = 0;
let digests: usize = 0;
let shown: usize = 0;
let mostGaussians: i32 = 0;
let mostPairs: u32 = 0;
let mostTiles: i32 = 0;

let firstColumn: i32 = 0;
let endColumn: i32 = 0;
let height: i32 = 0;

// What the last picture drew, in columns and rows of tiles.
let changedLeft: i32 = 0;
let changedRight: i32 = 0;
let changedTop: i32 = 0;
let changedBottom: i32 = 0;

/**
 * Lays out the memory for pictures of so many Gaussians, pairs of splat and tile, and tiles, at most.
 * What there is room for stays where it is: nothing is ever given back.
 */
export function layOut(gaussians: i32, newMostPairs: u32, tiles: i32): void {
  if (gaussians > mostGaussians) {
    mostGaussians = gaussians;
    useRoom(reserve(<usize>gaussians * RECORD), reserve(<usize>gaussians << 2));
    order = reserve(<usize>gaussians << 3);
    spare = reserve(<usize>gaussians << 3);
    digests = reserve(<usize>gaussians << 3);
  }
  if (newMostPairs > mostPairs) {
    mostPairs = newMostPairs;
    pairs = reserve(<usize>newMostPairs << 3);
    entries = reserve(<usize>newMostPairs << 2);
  }
  if (tiles > mostTiles) {
    mostTiles = tiles;
    counts = reserve(<usize>tiles << 2);
    shown = reserve(<usize>tiles << 3);
  }
  useRoomToKeep(digests, shown);
}

/** Begins a picture of which the columns of tiles from `first` to `end` are drawn. */
export function begin(fx: f32, fy: f32, cx: f32, cy: f32, width: i32, newHeight: i32, first: i32, end: i32): void {
  firstColumn = first;
  endColumn = end;
  height = newHeight;
  beginProjection(fx, fy, cx, cy, <f32>width, <f32>newHeight, <f32>(first * TILE_WIDTH), <f32>min(width, end * TILE_WIDTH));
}

/**
 * Sorts the splats of this picture into tiles.
 *
 * @param all whether all pairs are wanted; else the farthest are left out where there is no room
 * @returns false where there was no room for all
 */
export function bin(all: bool): bool {
  const down = (height + TILE_HEIGHT - 1) / TILE_HEIGHT;
  sortByDepth(order, spare);
  const number = listPairs(spare, pairs, mostPairs, all, counts, firstColumn, endColumn, down);
  if (number > mostPairs) return false;
  fillTiles(pairs, number, counts, (endColumn - firstColumn) * down, entries);
  return true;
}

/** Writes the background of the band, see `cloth.ts`; tiles in which it changed are drawn anew with the next picture. */
export function spread(colours: usize, columns: i32, step: i32, behind: usize, stride: usize): void {
  spreadCloth(colours, columns, step, firstColumn, endColumn, height, behind, stride);
}

/**
 * Draws the band: RGBA, rows of `stride` bytes, over another picture of the same shape.
 *
 * @param keep tiles whose splats and background are those of the picture before keep their pixels
 * @returns number of the tiles that were drawn
 */
export function draw(behind: usize, pixels: usize, stride: usize, keep: bool): i32 {
  const down = (height + TILE_HEIGHT - 1) / TILE_HEIGHT;
  let begin = entries;
  let counter = counts;
  let drawn = 0;
  changedLeft = i32.MAX_VALUE;
  changedTop = i32.MAX_VALUE;
  changedRight = 0;
  changedBottom = 0;
  if (!keep) forget((endColumn - firstColumn) * down);
  digestSplats();
  for (let column = firstColumn; column < endColumn; column++) {
    for (let row = 0; row < down; row++) {
      const end = entries + (<usize>load<u32>(counter) << 2);
      const above = row * TILE_HEIGHT;
      const place = <usize>above * stride + <usize>((column - firstColumn) * 4 * TILE_WIDTH);
      if (!keeps((counter - counts) >> 2, begin, end)) {
        drawTile(begin, end, column * TILE_WIDTH, above, <usize>min(TILE_HEIGHT, height - above), behind + place, pixels + place, stride);
        drawn++;
        changedLeft = min(changedLeft, column);
        changedRight = max(changedRight, column + 1);
        changedTop = min(changedTop, row);
        changedBottom = max(changedBottom, row + 1);
      }
      begin = end;
      counter += 4;
    }
  }
  return drawn;
}

/** The tiles that were drawn last lie within these columns of the picture and rows of tiles. */
export function firstChangedColumn(): i32 {
  return changedLeft;
}

export function endChangedColumn(): i32 {
  return changedRight;
}

export function firstChangedRow(): i32 {
  return changedTop;
}

export function endChangedRow(): i32 {
  return changedBottom;
}

/** Number of the splats that are seen in the band. */
export function seen(): i32 {
  return count;
}
