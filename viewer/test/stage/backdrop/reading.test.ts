import { gzipSync } from 'node:zlib';
import { describe, expect, test, vi } from 'vitest';
import { checkSplats, readSplats } from '../../../src/stage/backdrop/file.ts';
import { makeStillBackdrop, StillGenerator } from '../../../src/stage/backdrop/still.ts';

const HARMONIC = 0.28209479177387814;
const COLUMNS = ['x', 'y', 'z', 'nx', 'f_dc_0', 'f_dc_1', 'f_dc_2', 'opacity', 'scale_0', 'scale_1', 'scale_2', 'rot_0', 'rot_1', 'rot_2', 'rot_3'];

/** A PLY file of rows in the order of `COLUMNS`. */
function ply(rows: number[][], columns = COLUMNS, format = 'binary_little_endian'): ArrayBuffer {
  const header = ['ply', `format ${format} 1.0`, 'comment of nobody', `element vertex ${rows.length}`, ...columns.map((name) => `property float ${name}`), 'end_header', ''].join('\n');
  const floats = new Uint8Array(Float32Array.from(rows.flat()).buffer);
  return Uint8Array.from([...new TextEncoder().encode(header), ...floats]).buffer;
}

/** A PLY file with a header's tables and so many bytes behind it. */
function bytesOf(tables: string, size: number): ArrayBuffer {
  const header = new TextEncoder().encode(`ply\nformat binary_little_endian 1.0\nelement ${tables}\nend_header\n`);
  const file = new Uint8Array(header.length + size);
  file.set(header);
  return file.buffer;
}

/** An SPZ file of tables of bytes, with positions in 4096ths. */
function spz(version: number, count: number, tables: number[][], pack: (bytes: Uint8Array) => Uint8Array = gzipSync): ArrayBuffer {
  const header = new DataView(new ArrayBuffer(16));
  for (const [i, word] of [0x5053474e, version, count].entries()) header.setUint32(4 * i, word, true);
  header.setUint8(13, 12);
  return new Uint8Array(pack(Uint8Array.from([...new Uint8Array(header.buffer), ...tables.flat()]))).buffer;
}

const word = (value: number) => [value, value >>> 8, value >>> 16, value >>> 24].map((byte) => byte & 255);
const fixed = (value: number) => word(value).slice(0, 3);

/** Rows that were read, without what nobody reads behind them. */
async function rowsOf(name: string, bytes: ArrayBuffer): Promise<number[][] | null> {
  const rows = await readSplats({ name, bytes });
  return rows && Array.from({ length: rows.length / 16 }, (_, i) => [...rows.subarray(16 * i, 16 * i + 14)]);
}

function expectRow(found: number[], expected: number[]): void {
  for (const [k, value] of expected.entries()) expect(found[k], `number ${k}`).toBeCloseTo(value, 6);
}

describe('splats behind a person', () => {
  test('are read from PLY', async () => {
    const rows = await rowsOf('background.ply', ply([[1, 2, 3, 9, 0, 1, -9, 0, 0, -1, Math.log(2), 0.5, -0.5, 0.5, 0.5], Array(15).fill(0)]));
    expect(rows).toHaveLength(2);
    expectRow(rows![0]!, [1, 2, 3, 0.5, -0.5, 0.5, 0.5, 1, Math.exp(-1), 2, 0.5, 0.5 + HARMONIC, 0, 0.5]);
    expectRow(rows![1]!, [0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 0.5, 0.5, 0.5, 0.5]);
  });

  test('are read from SPZ and turned to the axes of the world', async () => {
    const half = Math.SQRT1_2 / 511;
    const shared = [
      [...fixed(4096), ...fixed(-2048), ...fixed(1), ...fixed(-8388608), ...fixed(0), ...fixed(-1)],
      [255, 51],
      [255, 0, 51, 51, 51, 51],
      [160, 112, 160, 176, 160, 160],
    ];
    const colours = (byte: number) => Math.max(0, 0.5 + (HARMONIC * (byte / 255 - 0.5)) / 0.15);
    const turned = (100 << 20) | ((512 + 200) << 10) | 511; // x is the largest
    const rows = await rowsOf('background.spz', spz(3, 2, [...shared, [...word(3 << 30), ...word(turned)]]));
    expectRow(rows![0]!, [1, 0.5, -(2 ** -12), 1, 0, 0, 0, 1, Math.exp(-3), 1, colours(255), colours(0), colours(51), 1]);
    const x = Math.sqrt(1 - half ** 2 * (100 ** 2 + 200 ** 2 + 511 ** 2));
    expectRow(rows![1]!, [-2048, 0, 2 ** -12, Math.SQRT1_2, x, -100 * half, 200 * half, Math.E, 1, 1, colours(51), colours(51), colours(51), 0.2]);
    const older = await rowsOf('background.spz', spz(2, 2, [...shared, [255, 127, 127, 0, 127, 128]]));
    const small = 1 / 255;
    expectRow(older![0]!.slice(3, 7), [0, 1, small, small]); // nothing is left for w
    expectRow(older![1]!.slice(3, 7), [0, -1, small, -small]);
  });

  test('are left to Spark where the file is of another kind', async () => {
    const row = Array<number>(15).fill(0);
    expect(await rowsOf('background.ply', ply([row], [...COLUMNS.slice(0, -1), 'red']))).toBeNull();
    expect(await rowsOf('background.ply', ply([row], COLUMNS, 'binary_big_endian'))).toBeNull();
    expect(await rowsOf('background.ply', ply([row]).slice(0, -1))).toBeNull();
    expect(await rowsOf('background.ply', new ArrayBuffer(3))).toBeNull();
    expect(await rowsOf('background.spz', spz(4, 0, [], (bytes) => bytes))).toBeNull();
    expect(await makeStillBackdrop({ name: 'background.ply', bytes: new ArrayBuffer(3) })).toBeNull();
  });

  const row = Array(20).fill(0);
  const whole = spz(3, 1, [row]);
  test.each([
    ['of another version', spz(4, 1, [row])],
    ['of no splats', spz(3, 0, [])],
    ['that lacks a byte', spz(3, 1, [row.slice(1)])],
    ['of a header alone, cut', new Uint8Array(gzipSync(new Uint8Array(9))).buffer],
    ['that is cut off', whole.slice(0, -9)],
    ['that cannot hold what it promises', spz(3, 900_000, [row])],
    ['that goes on behind its splats', spz(3, 1, [row, [0]])],
  ])('are refused in a packed file %s', async (_, bytes) => {
    const sentence = 'background.spz holds no splats that this page can read.';
    await expect(rowsOf('background.spz', bytes)).rejects.toThrow(sentence);
    await expect(checkSplats({ name: 'background.spz', bytes })).rejects.toThrow(sentence);
  });

  test('are checked before Spark reads them', async () => {
    await checkSplats({ name: 'background.spz', bytes: whole });
    const floats = ply([Array(15).fill(0)]);
    await checkSplats({ name: 'background.ply', bytes: floats });
    await checkSplats({ name: 'background.spz', bytes: floats });
    await checkSplats({ name: 'background.ply', bytes: bytesOf('chunk 1\nproperty float a\nelement vertex 2\nproperty uint b\nproperty uchar c', 14) });
    const zip = new TextEncoder().encode('PK\x03\x04').buffer;
    await expect(checkSplats({ name: 'background.ply', bytes: zip })).rejects.toThrow('no splats that this page can read');
  });

  test.each([
    ['without splats', bytesOf('vertex 0\nproperty uchar a', 0)],
    ['of more splats than there may be', bytesOf('vertex 1000001\nproperty uchar a', 1_000_001)],
    ['that lacks a byte', bytesOf('vertex 9\nproperty ushort a', 17)],
    ['that goes on behind its tables', bytesOf('vertex 9\nproperty ushort a', 19)],
    ['of two tables of splats', bytesOf('vertex 1\nproperty uchar a\nelement vertex 1000000\nproperty uchar a', 1_000_001)],
    ['of lists', bytesOf('vertex 9\nproperty list uchar int a', 36)],
    ['of rows without columns', bytesOf('vertex 9\nproperty uchar a\nelement face 900000000', 9)],
    ['whose number is none', bytesOf('vertex 0x9\nproperty uchar a', 9)],
    ['without an end of its header', new TextEncoder().encode('ply\nformat binary_little_endian 1.0\n').buffer],
  ])('are refused in a PLY %s', async (_, bytes) => {
    await expect(checkSplats({ name: 'background.ply', bytes })).rejects.toThrow('no splats that this page can read');
  });

  test('are not unpacked further than their header promises', async () => {
    let unpacked = 0; // bytes
    const Stream = DecompressionStream;
    vi.stubGlobal('DecompressionStream', function (kind: 'gzip') {
      const { readable, writable } = new Stream(kind);
      const transform = (part: Uint8Array, controller: TransformStreamDefaultController) => {
        unpacked += part.length;
        controller.enqueue(part);
      };
      return { writable, readable: readable.pipeThrough(new TransformStream({ transform })) };
    });
    const bytes = spz(3, 1, [row], (all) => gzipSync(Buffer.concat([all, Buffer.alloc(16 << 20)])));
    await expect(rowsOf('background.spz', bytes)).rejects.toThrow('no splats that this page can read');
    vi.unstubAllGlobals();
    expect(unpacked).toBeLessThan(8 << 20);
  });

  test('are drawn the largest ones first, and a share of them where pictures take too long', async () => {
    const sizes = [0.1, 0.4, 0.2, 0.3];
    const rows = sizes.map((size) => [size, 0, 0, 0, 0, 0, 0, 0, Math.log(size), Math.log(size), -9, 1, 0, 0, 0]);
    const backdrop = (await makeStillBackdrop({ name: 'background.ply', bytes: ply(rows) }))!;
    const generator = backdrop.objects[0] as StillGenerator;
    const places = new Float32Array(generator.soft.source!.rows).filter((_, at) => at % 16 === 0);
    expect([...places]).toEqual([0.4, 0.3, 0.2, 0.1].map(Math.fround));
    expect(generator.soft.drawn).toBe(4);
    const { version } = generator;
    backdrop.thin!(0.3);
    expect(generator.soft.drawn).toBe(2);
    expect(generator.version).toBeGreaterThan(version);
  });
});
