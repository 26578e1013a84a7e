const SIDE = 512;
const MOST_BYTES = 1 << 20;
const SIGNATURE = [0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a];

/**
 * A bundle's thumbnail, which may be another server's: a browser unpacks a picture whatever its size, 1 GB of a few kilobytes.
 *
 * @returns null where it is no small PNG picture, or cannot be had
 */
export async function smallPicture(address: string, signal: AbortSignal): Promise<Blob | null> {
  try {
    const response = await fetch(address, { signal });
    const bytes = response.ok && response.body ? await readFew(response.body.getReader()) : null;
    return bytes && isSmallPng(bytes) ? new Blob([bytes], { type: 'image/png' }) : null;
  } catch {
    return null; // somebody comes without a picture before
  }
}

/** All bytes of a stream, null if they are too many. */
async function readFew(reader: ReadableStreamDefaultReader<Uint8Array>): Promise<Uint8Array<ArrayBuffer> | null> {
  const bytes = new Uint8Array(MOST_BYTES);
  let at = 0;
  for (let part = await reader.read(); !part.done; part = await reader.read()) {
    if (at + part.value.length > MOST_BYTES) {
      reader.cancel().catch(() => {});
      return null;
    }
    bytes.set(part.value, at);
    at += part.value.length;
  }
  return bytes.subarray(0, at);
}

/** Whether a file is a PNG picture as small as servers allow, by its first bytes. */
export function isSmallPng(bytes: Uint8Array): boolean {
  if (bytes.length < 33 || SIGNATURE.some((byte, i) => bytes[i] !== byte)) return false;
  const view = new DataView(bytes.buffer, bytes.byteOffset);
  const isFirst = view.getUint32(12) === 0x49484452; // IHDR
  return isFirst && [16, 20].every((at) => view.getUint32(at) >= 1 && view.getUint32(at) <= SIDE);
}
