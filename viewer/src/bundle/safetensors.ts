import { PageError } from '../errors.ts';
import { allFinite, floatsFromHalves } from '../numbers.ts';

type Values = Float32Array | Int16Array | Uint16Array | Int8Array | Uint8Array; // half floats are widened

/** One array of a safetensors file. */
export interface Tensor {
  dtype: 'F32' | 'F16' | 'I16' | 'U16' | 'I8' | 'U8';
  shape: number[];
  readonly data: Values; // made when it is first asked for: nobody may want it
}

interface Entry {
  dtype: string;
  shape: number[];
  data_offsets: [number, number];
}

const BYTES: Record<string, number> = { F32: 4, F16: 2, I16: 2, U16: 2, I8: 1, U8: 1 };
const HEADER_LIMIT = 1 << 20;
const METADATA = '__metadata__';

/**
 * Reads a safetensors file (u64 header length, JSON header, data; little-endian).
 *
 * @param file name for error sentences
 * @throws PageError if the file contradicts itself or holds a type that bundles do not use
 */
export function parseSafetensors(buffer: ArrayBuffer, file: string): Map<string, Tensor> {
  const { header, length } = readHeader(buffer, file);
  const base = 8 + length;
  const entries = Object.entries(header).filter(([name]) => name !== METADATA) as [string, Entry][];
  for (const [name, entry] of entries) checkEntry(entry, buffer.byteLength - base, `${file}: ${name}`);
  checkCover(entries.map(([, entry]) => entry.data_offsets), buffer.byteLength - base, file);
  return new Map(entries.map(([name, entry]) => [name, readTensor(buffer, base, entry)]));
}

/**
 * The texts in the header of a safetensors file.
 *
 * @param file name for error sentences
 * @throws PageError if the file has no readable header
 */
export function parseMetadata(buffer: ArrayBuffer, file: string): Record<string, string> {
  return (readHeader(buffer, file).header[METADATA] ?? {}) as Record<string, string>;
}

function readHeader(buffer: ArrayBuffer, file: string): { header: Record<string, unknown>; length: number } {
  if (buffer.byteLength < 8) throw new PageError(`${file} is too short for a safetensors file.`);
  const length = Number(new DataView(buffer).getBigUint64(0, true));
  if (length > HEADER_LIMIT || 8 + length > buffer.byteLength) {
    throw new PageError(`${file} ends before its header does.`);
  }
  return { header: parseHeader(new Uint8Array(buffer, 8, length), file), length };
}

function parseHeader(bytes: Uint8Array, file: string): Record<string, unknown> {
  try {
    return JSON.parse(new TextDecoder('utf-8', { fatal: true }).decode(bytes)) as Record<string, unknown>;
  } catch {
    throw new PageError(`${file} has a header that is not JSON.`);
  }
}

function checkEntry({ dtype, shape, data_offsets: [begin, end] }: Entry, size: number, where: string): void {
  const itemSize = BYTES[dtype];
  if (itemSize === undefined) throw new PageError(`${where} has the unexpected type ${dtype}.`);
  const count = shape.reduce((product, length) => product * length, 1);
  if (end - begin !== count * itemSize || begin < 0 || end > size) throw new PageError(`${where} does not fit its shape.`);
}

/** Tensors must fill the file without gap or overlap: else a small file could hold any number of large ones. */
function checkCover(spans: [number, number][], size: number, file: string): void {
  let at = 0;
  for (const [begin, end] of spans.toSorted((a, b) => a[0] - b[0] || a[1] - b[1])) {
    if (begin !== at) throw new PageError(`${file}: its tensors overlap or leave a gap.`);
    at = end;
  }
  if (at !== size) throw new PageError(`${file} has bytes that belong to no tensor.`);
}

function readTensor(buffer: ArrayBuffer, base: number, { dtype, shape, data_offsets: [begin, end] }: Entry): Tensor {
  let data: Values | undefined;
  return {
    dtype: dtype as Tensor['dtype'],
    shape,
    get data() {
      return (data ??= valuesOf(dtype, buffer.slice(base + begin, base + end))); // a copy is aligned whatever the header's length
    },
  };
}

function valuesOf(dtype: string, bytes: ArrayBuffer): Values {
  if (dtype === 'I8') return new Int8Array(bytes);
  if (dtype === 'U8') return new Uint8Array(bytes);
  if (dtype === 'I16') return new Int16Array(bytes);
  if (dtype === 'U16') return new Uint16Array(bytes);
  return dtype === 'F16' ? floatsFromHalves(new Uint16Array(bytes)) : new Float32Array(bytes);
}

/**
 * Takes a tensor of known type and shape out of a file.
 *
 * @throws PageError if it is missing, of another type or shape, or not finite
 */
export function takeTensor(
  tensors: Map<string, Tensor>,
  name: string,
  dtype: Tensor['dtype'],
  shape: number[],
  file: string,
): Tensor {
  const tensor = tensors.get(name);
  if (!tensor) throw new PageError(`${file} lacks ${name}.`);
  if (tensor.dtype !== dtype || tensor.shape.join() !== shape.join()) {
    throw new PageError(
      `${file}: ${name} is ${tensor.dtype} (${tensor.shape}) and should be ${dtype} (${shape}).`,
    );
  }
  if (dtype.startsWith('F') && !allFinite(tensor.data)) {
    throw new PageError(`${file}: ${name} holds numbers that are not finite.`);
  }
  return tensor;
}
