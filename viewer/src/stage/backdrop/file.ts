import { checkPly, isPly, readPly } from './ply.ts';
import { readSpz } from './spz.ts';
import { isBounded, isPacked, unpack, unreadable } from './unpacking.ts';

/** A file of splats. */
export interface SplatFile {
  name: string; // which tells the format
  bytes: ArrayBuffer;
}

/** Whether the splats of a file have the axes of SPZ: turned by half around x, they have those of all else. */
export function isTurned({ name }: SplatFile): boolean {
  return name.endsWith('.spz');
}

/**
 * Reads splats: a row of a source that stands still (`soft/source.ts`) for each, in the order of the
 * file and with the axes of the world. Seen from everywhere they have the colour of their mean.
 *
 * @returns null for a kind that only Spark reads: compressed PLY, SPZ of version 4
 * @throws PageError if it is damaged
 */
export async function readSplats(file: SplatFile): Promise<Float32Array | null> {
  return isTurned(file) ? readSpz(file.bytes, file.name) : readPly(file.bytes);
}

/**
 * Checks a file before Spark reads it, which tells kinds by their first bytes, and unpacks without a limit.
 *
 * @throws PageError if it is of no kind that a background may have, or unpacks to more than its header promises
 */
export async function checkSplats({ name, bytes }: SplatFile): Promise<void> {
  if (isPacked(bytes)) await unpack(bytes, name);
  else if (isPly(bytes)) checkPly(bytes, name);
  else if (!isBounded(bytes)) throw unreadable(name);
}
