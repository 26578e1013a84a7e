import { RECORD } from './numbers.ts';
import { count, records } from './project.ts';
import { splatOf } from './tiles.ts';

/** Tells tiles that show what they showed in the picture before: their splats and rows have the same digest. */

const BASIS: u64 = 0xcbf29ce484222325;
const PRIME: u64 = 0x9e3779b97f4a7c15;
const ROWS_MASK: u32 = (1 << 13) - 1;

let digests: usize = 0; // u64 for each splat
let shown: usize = 0; // u64 for each tile, of what it shows; 0 where nobody knows

export function useRoomToKeep(toDigests: usize, toShown: usize): void {
  digests = toDigests;
  shown = toShown;
}

// @ts-ignore: decorator
@inline
function mixed(digest: u64, word: u64): u64 {
  const product = (digest ^ word) * PRIME;
  return product ^ (product >> 32);
}

/** Digests the records of all splats. */
export function digestSplats(): void {
  for (let i: usize = 0; i < <usize>count; i++) {
    let digest = BASIS;
    for (let at = records + i * RECORD, end = at + RECORD; at < end; at += 8) digest = mixed(digest, load<u64>(at));
    store<u64>(digests + (i << 3), digest);
  }
}

/** Nobody knows what any tile shows. */
export function forget(tiles: i32): void {
  memory.fill(shown, 0, 8 * <usize>tiles);
}

/** Nobody knows what a tile shows. */
export function renew(tile: usize): void {
  store<u64>(shown + (tile << 3), 0);
}

/** Whether a tile with these entries shows them already; from now on it does. */
export function keeps(tile: usize, entries: usize, end: usize): bool {
  let digest = BASIS;
  for (let at = entries; at < end; at += 4) {
    const entry = load<u32>(at);
    digest = mixed(digest, load<u64>(digests + (splatOf(entry) << 3)) + <u64>(entry & ROWS_MASK));
  }
  const before = load<u64>(shown + (tile << 3));
  store<u64>(shown + (tile << 3), digest);
  return before == digest;
}
