/** Pixels across a tile, as in `kernel/numbers.ts`. */
export const TILE_WIDTH = 4;
/** Pixels down a tile. */
export const TILE_HEIGHT = 64;
