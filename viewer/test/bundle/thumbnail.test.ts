import { afterEach, expect, test, vi } from 'vitest';
import { isSmallPng, smallPicture } from '../../src/bundle/thumbnail.ts';

function png(width: number, height: number, size = 100): Uint8Array<ArrayBuffer> {
  const bytes = new Uint8Array(size);
  bytes.set([0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a, 0, 0, 0, 13, 0x49, 0x48, 0x44, 0x52]);
  const view = new DataView(bytes.buffer);
  view.setUint32(16, width);
  view.setUint32(20, height);
  return bytes;
}

const answer = (bytes: Uint8Array<ArrayBuffer>, status = 200) =>
  vi.stubGlobal('fetch', () => Promise.resolve(new Response(bytes, { status })));
const { signal } = new AbortController();
afterEach(() => vi.unstubAllGlobals());

test('a small PNG picture is one by its first bytes', () => {
  expect(isSmallPng(png(512, 512))).toBe(true);
  for (const [width, height] of [[513, 1], [1, 16_000], [0, 9], [2 ** 31, 2 ** 31]] as const) expect(isSmallPng(png(width, height))).toBe(false);
  expect(isSmallPng(png(9, 9).subarray(0, 32))).toBe(false);
  expect(isSmallPng(new TextEncoder().encode('<svg xmlns="http://www.w3.org/2000/svg" width="9"/>'))).toBe(false);
});

test('of another server nothing else is shown', async () => {
  answer(png(384, 512));
  expect((await smallPicture('thumbnail.png', signal))!.size).toBe(100);
  answer(png(16_000, 16_000));
  expect(await smallPicture('thumbnail.png', signal)).toBeNull();
  answer(png(9, 9, (1 << 20) + 1));
  expect(await smallPicture('thumbnail.png', signal)).toBeNull();
  answer(png(9, 9), 404);
  expect(await smallPicture('thumbnail.png', signal)).toBeNull();
  vi.stubGlobal('fetch', () => Promise.reject(new TypeError('Failed to fetch')));
  expect(await smallPicture('thumbnail.png', signal)).toBeNull();
});
