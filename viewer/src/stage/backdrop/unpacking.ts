import { PageError } from '../../errors.ts';
import { MAX_GAUSSIANS, SPZ } from '../../shared.ts';

const GZIP = 0x8b1f;
const MAGIC = 0x5053474e; // NGSP
const ANTIALIASED = 1; // all other flags announce further data
const PIECE = 1 << 12; // packed bytes at a time: they become a thousand times as many at most

/** Bytes of the header of an SPZ file. */
export const HEADER = 16;

/** Whether a file is packed as SPZ of version 2 and 3 is, whatever its name. */
export function isPacked(bytes: ArrayBuffer): boolean {
  return bytes.byteLength >= 2 && new DataView(bytes).getUint16(0, true) === GZIP;
}

/** Whether a file begins as SPZ of version 4 does, and promises no more splats than there may be. */
export function isBounded(bytes: ArrayBuffer): boolean {
  if (bytes.byteLength < HEADER) return false;
  const header = new DataView(bytes);
  return header.getUint32(0, true) === MAGIC && isAllowed(header.getUint32(8, true));
}

/** Whether there may be so many splats. */
export function isAllowed(count: number): boolean {
  return count >= 1 && count <= MAX_GAUSSIANS;
}

/** What is said of splats that cannot be read. */
export function unreadable(name: string): PageError {
  return new PageError(`${name} holds no splats that this page can read.`);
}

/**
 * Unpacks an SPZ file of version 2 or 3, and stops where it is more than its header allows.
 *
 * @returns header and tables
 * @throws PageError if it is damaged, or more
 */
export async function unpack(bytes: ArrayBuffer, name: string): Promise<Uint8Array<ArrayBuffer>> {
  const reader = inPieces(bytes).pipeThrough(new DecompressionStream('gzip')).getReader();
  const unpacked = new Unpacked(bytes.byteLength);
  try {
    for (let part = await reader.read(); !part.done; part = await reader.read()) {
      if (!unpacked.add(part.value)) throw unreadable(name);
    }
  } catch {
    reader.cancel().catch(() => {});
    throw unreadable(name);
  }
  if (!unpacked.isWhole) throw unreadable(name);
  return unpacked.kept;
}

/** The bytes, as they are asked for. */
function inPieces(bytes: ArrayBuffer): ReadableStream<Uint8Array<ArrayBuffer>> {
  let at = 0;
  return new ReadableStream({
    pull(controller) {
      const size = Math.min(PIECE, bytes.byteLength - at);
      if (size > 0) controller.enqueue(new Uint8Array(bytes, at, size));
      else controller.close();
      at += size;
    },
  });
}

/** What an SPZ file unpacks to, as it comes. */
class Unpacked {
  /** The header and, once that is there, room for what it promises. */
  kept: Uint8Array<ArrayBuffer> = new Uint8Array(HEADER);
  private readonly packed: number; // bytes of the file
  private size = 0;
  private most = 0; // bytes; 0 for a header that is none

  constructor(packed: number) {
    this.packed = packed;
  }

  get isWhole(): boolean {
    return this.size >= Math.max(HEADER, this.kept.length);
  }

  /** Takes what came; false if the file is none that can be read. */
  add(part: Uint8Array): boolean {
    const inHeader = HEADER - this.size;
    this.keep(part);
    if (inHeader > 0 && part.length >= inHeader) {
      this.readHeader();
      this.size = HEADER;
      this.keep(part.subarray(inHeader));
    }
    return this.size < HEADER || this.size <= this.most;
  }

  private keep(part: Uint8Array): void {
    const room = Math.max(0, this.kept.length - this.size);
    if (room > 0) this.kept.set(part.subarray(0, room), this.size);
    this.size += part.length;
  }

  /** Makes room for the tables, if a file of this size can hold them. */
  private readHeader(): void {
    const data = new DataView(this.kept.buffer);
    const [magic, version, count] = [0, 4, 8].map((at) => data.getUint32(at, true)) as [number, number, number];
    const [degree, flags] = [data.getUint8(12), data.getUint8(14)];
    const row = (version === 2 ? 19 : 20) + 3 * ((degree + 1) ** 2 - 1);
    const allowed = SPZ.ratio * this.packed + SPZ.free;
    const isKnown = magic === MAGIC && (version === 2 || version === 3) && degree <= SPZ.degree;
    if (!isKnown || !isAllowed(count) || count * row > allowed) return;
    const all = new Uint8Array(HEADER + count * row);
    all.set(this.kept);
    this.kept = all;
    this.most = flags & ~ANTIALIASED ? HEADER + allowed : all.length;
  }
}
