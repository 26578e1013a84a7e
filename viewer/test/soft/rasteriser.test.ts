import { describe, expect, test } from 'vitest';
import { makeKernel } from '../../src/soft/kernel.ts';
import { Rasteriser, type Frame } from '../../src/soft/rasteriser.ts';
import { TILE_WIDTH } from '../../src/soft/tiles.ts';
import { psnr, worst } from '../../support/browser/pictures.ts';
import { makeGaussians } from '../../support/references/gaussians/reference.ts';

const WIDTH = 202; // of half a tile more than whole ones
const HEIGHT = 150;
const COLUMNS = Math.ceil(WIDTH / TILE_WIDTH);

const reference = makeGaussians({ gaussians: 2000, size: `${WIDTH}x${HEIGHT}` });
const rasteriser = new Rasteriser(await makeKernel());
rasteriser.put(0, reference.source);

describe('the rasteriser', () => {
  const frame = (first: number, end: number, drawn = reference.source.count): Frame => ({
    lens: reference.lens,
    width: WIDTH,
    height: HEIGHT,
    band: [first, end],
    placed: [{ id: 0, view: reference.view, drawn, values: new Float32Array(0) }],
  });

  /** A band of the picture, (H, W, 3) with the width of its tiles. */
  const draw = (wanted: Frame, by = rasteriser): Uint8Array => {
    const [red, green, blue] = reference.background.map((value) => Math.round(255 * value)) as [number, number, number];
    const [first, end] = wanted.band;
    const behind = new Uint32Array(TILE_WIDTH * (end - first) * HEIGHT).fill(red | (green << 8) | (blue << 16));
    return by.draw(wanted, behind).filter((_, at) => at % 4 < 3);
  };

  /** The columns from `left` to `right` of a picture of some width. */
  const columns = (picture: Uint8Array, width: number, left: number, right: number): Uint8Array =>
    picture.filter((_, at) => Math.floor(at / 3) % width >= left && Math.floor(at / 3) % width < right);

  test('draws what Python draws', () => {
    const drawn = columns(draw(frame(0, COLUMNS)), TILE_WIDTH * COLUMNS, 0, WIDTH);
    const likeness = psnr(drawn, reference.picture);
    console.log(`${likeness.toFixed(1)} dB, at most ${worst(drawn, reference.picture)} of 255 off`);
    expect(likeness).toBeGreaterThan(60);
    const fewer = columns(draw(frame(0, COLUMNS, 1900)), TILE_WIDTH * COLUMNS, 0, WIDTH);
    expect(psnr(fewer, reference.picture)).toBeLessThan(45);
  });

  test('draws bands that are parts of the picture, to the bit', () => {
    const whole = draw(frame(0, COLUMNS));
    for (const [first, end] of [[0, 7], [7, 30], [30, COLUMNS]] as const) {
      const part = columns(whole, TILE_WIDTH * COLUMNS, TILE_WIDTH * first, TILE_WIDTH * end);
      expect(worst(draw(frame(first, end)), part), `${first} to ${end}`).toBe(0);
    }
  });

  test('makes room for more pairs than it expected', async () => {
    const small = new Rasteriser(await makeKernel(), 100);
    small.put(0, reference.source);
    expect(worst(draw(frame(0, COLUMNS), small), draw(frame(0, COLUMNS)))).toBe(0);
  });

  test('keeps the pixels of tiles that did not change, and no others', async () => {
    const behind = new Uint32Array(TILE_WIDTH * COLUMNS * HEIGHT).fill(0x336699);
    const [keeping, fresh] = [new Rasteriser(await makeKernel()), new Rasteriser(await makeKernel())];
    for (const one of [keeping, fresh]) one.put(0, reference.source);
    const tiles = COLUMNS * 3;
    const near = frame(0, COLUMNS);
    keeping.draw(near, behind);
    expect(keeping.drawnTiles).toBe(tiles);
    keeping.draw(near, behind);
    expect(keeping.drawnTiles).toBe(0);
    // One Gaussian after another is left out, comes back, or moves with all others.
    for (const drawn of [1999, 1990, 1998, 2000]) {
      const picture = keeping.draw({ ...near, placed: [{ ...near.placed[0]!, drawn }] }, behind);
      expect(keeping.drawnTiles).toBeLessThan(tiles);
      expect(worst(picture, fresh.draw({ ...near, placed: [{ ...near.placed[0]!, drawn }] }, behind.slice()))).toBe(0);
      expect(fresh.drawnTiles).toBe(tiles);
    }
    const moved = near.placed[0]!.view.map((value, i) => value + (i === 3 ? 0.01 : 0));
    const picture = keeping.draw({ ...near, placed: [{ ...near.placed[0]!, view: moved }] }, behind);
    expect(worst(picture, fresh.draw({ ...near, placed: [{ ...near.placed[0]!, view: moved }] }, behind.slice()))).toBe(0);
    // Another background, and another shape, are drawn anew.
    keeping.draw(near, behind.slice());
    expect(keeping.drawnTiles).toBe(tiles);
    keeping.draw(frame(0, COLUMNS - 1), behind);
    expect(keeping.drawnTiles).toBe(tiles - 3);
  });

  test('shows the background where nothing is', () => {
    const picture = draw(frame(0, COLUMNS, 0));
    expect(new Set(picture)).toEqual(new Set(reference.background.map((value) => Math.round(255 * value))));
  });
});
