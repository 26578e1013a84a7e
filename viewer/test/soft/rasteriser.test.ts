import { describe, expect, test } from 'vitest';
import { makeKernel } from '../../src/soft/kernel.ts';
import { Rasteriser, type Frame } from '../../src/soft/rasteriser.ts';
import { TILE_HEIGHT, TILE_WIDTH } from '../../src/soft/tiles.ts';
import { psnr, worst } from '../../support/browser/pictures.ts';
import { clothOf } from '../../support/browser/view.ts';
import { makeGaussians } from '../../support/references/gaussians/reference.ts';

const WIDTH = 202; // of half a tile more than whole ones
const HEIGHT = 150;
const COLUMNS = Math.ceil(WIDTH / TILE_WIDTH);

const reference = makeGaussians({ gaussians: 2000, size: `${WIDTH}x${HEIGHT}` });
const background = clothOf(reference.background, WIDTH, HEIGHT);
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
    by.forget();
    return by.draw(wanted, background).filter((_, at) => at % 4 < 3);
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

  test('takes hardly more memory for a window that becomes larger little by little, and for more and more Gaussians', async () => {
    const drawn = async (sizes: readonly (readonly [height: number, count: number])[]) => {
      const kernel = await makeKernel();
      const growing = new Rasteriser(kernel, 2 ** 12);
      growing.put(0, reference.source);
      for (const [height, count] of sizes) growing.draw({ ...frame(0, COLUMNS, count), height }, clothOf(reference.background, WIDTH, height));
      return kernel.memory.buffer.byteLength;
    };
    const largest = await drawn([[1600, 2000]]);
    const steps = Array.from({ length: 200 }, (_, i) => [8 * i + 8, 10 * i + 10] as const);
    expect(await drawn(steps)).toBeLessThan(3 * largest);
  });

  test('takes hardly more memory for sources that take turns, each larger than the one before', async () => {
    const kernel = await makeKernel();
    const growing = new Rasteriser(kernel);
    for (let count = 1; count <= 20_000; count += 50) {
      growing.put(0, { kind: 'still', count, rows: new ArrayBuffer(64 * count), sizes: [] });
    }
    expect(kernel.memory.buffer.byteLength).toBeLessThan(8 * 64 * 20_000);
  });

  test('makes no room for what a Gaussian has outside of the picture', async () => {
    const view = Float32Array.of(1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0);
    const [pictures, bytes] = [[] as Uint8Array[], [] as number[]];
    for (const size of [10, Math.exp(9)]) {
      const kernel = await makeKernel();
      const one = new Rasteriser(kernel, 1000);
      one.put(0, { kind: 'still', count: 1, rows: Float32Array.of(0, 0, 2, 1, 0, 0, 0, size, size, size, 0.5, 0.4, 0.3, 0.9, 0, 0).buffer, sizes: [] });
      pictures.push(draw({ ...frame(0, COLUMNS), placed: [{ id: 0, view, drawn: 1, values: new Float32Array(0) }] }, one));
      bytes.push(kernel.memory.buffer.byteLength);
    }
    expect(worst(pictures[1]!, pictures[0]!)).toBeLessThanOrEqual(1);
    expect(bytes[1]).toBe(bytes[0]);
  });

  test('leaves out the farthest of Gaussians that would fill the memory', async () => {
    const view = Float32Array.of(1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0);
    const [pictures, bytes] = [[] as Uint8Array[], [] as number[]];
    for (const count of [100, 60_000]) {
      const rows = new Float32Array(16 * count);
      for (let i = 0; i < count; i++) rows.set([0, 0, 2 + i * 1e-5, 1, 0, 0, 0, 10, 10, 10, 0.5, 0.4, 0.3, 0.9, 0, 0], 16 * i);
      const kernel = await makeKernel();
      const one = new Rasteriser(kernel);
      one.put(0, { kind: 'still', count, rows: rows.buffer, sizes: [] });
      pictures.push(draw({ ...frame(0, COLUMNS), placed: [{ id: 0, view, drawn: count, values: new Float32Array(0) }] }, one));
      bytes.push(kernel.memory.buffer.byteLength);
    }
    expect(worst(pictures[1]!, pictures[0]!)).toBe(0);
    expect(bytes[1]! - bytes[0]!).toBeLessThan(3e8);
  });

  test('lists no Gaussian more often than there are tiles, whatever its numbers are', async () => {
    const [kernel, rows] = [await makeKernel(), Math.ceil(HEIGHT / TILE_HEIGHT)];
    const [view, at] = [kernel.reserve(48), kernel.reserve(64)];
    new Float32Array(kernel.memory.buffer, view, 12).set([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0]);
    kernel.layOut(1, COLUMNS * rows, COLUMNS * rows);
    const places = [0, 1, 1e4, -1e4, 1e7, -1e7, 1e30, Infinity, NaN];
    const sizes = [1e-3, 1, 1e3, 1e6, 1e9, 1e30, Infinity, NaN];
    let seen = 0;
    for (const x of places)
      for (const y of places)
        for (const wide of sizes)
          for (const high of sizes) {
            new Float32Array(kernel.memory.buffer, at, 16).set([x, y, 1, 1, 0, 0, 0.3, wide, high, 1, 0.5, 0.4, 0.3, 0.9, 0, 0]);
            kernel.begin(100, 100, 100, 75, WIDTH, HEIGHT, 0, COLUMNS);
            kernel.fade(1, 1, 1);
            kernel.addStill(view, at, 1);
            seen += kernel.seen();
            expect(kernel.bin(1), `${x}, ${y}, ${wide}, ${high}`).toBe(1);
          }
    expect(seen).toBeGreaterThan(100);
  });

  test('keeps the pixels of tiles that did not change, and no others', async () => {
    const [keeping, fresh] = [new Rasteriser(await makeKernel()), new Rasteriser(await makeKernel())];
    for (const one of [keeping, fresh]) one.put(0, reference.source);
    const tiles = COLUMNS * 3;
    const near = frame(0, COLUMNS);
    keeping.draw(near, background);
    expect(keeping.drawnTiles).toBe(tiles);
    keeping.draw(near, background);
    expect(keeping.drawnTiles).toBe(0);
    // One Gaussian after another is left out, comes back, or moves with all others.
    for (const drawn of [1999, 1990, 1998, 2000]) {
      const picture = keeping.draw({ ...near, placed: [{ ...near.placed[0]!, drawn }] }, background);
      expect(keeping.drawnTiles).toBeLessThan(tiles);
      fresh.forget();
      expect(worst(picture, fresh.draw({ ...near, placed: [{ ...near.placed[0]!, drawn }] }, background))).toBe(0);
      expect(fresh.drawnTiles).toBe(tiles);
    }
    const moved = near.placed[0]!.view.map((value, i) => value + (i === 3 ? 0.01 : 0));
    const picture = keeping.draw({ ...near, placed: [{ ...near.placed[0]!, view: moved }] }, background);
    fresh.forget();
    expect(worst(picture, fresh.draw({ ...near, placed: [{ ...near.placed[0]!, view: moved }] }, background))).toBe(0);
    // Another background, none, and another shape, are drawn anew.
    for (const cloth of [clothOf([0.1, 0.2, 0.3], WIDTH, HEIGHT), { ...background, colours: null }, background]) {
      keeping.draw(near, cloth);
      expect(keeping.drawnTiles).toBe(tiles);
    }
    keeping.draw(frame(0, COLUMNS - 1), background);
    expect(keeping.drawnTiles).toBe(tiles - 3);
  });

  test('lets the Gaussians of a head that came later appear by their opacity, and the first ones be wider', async () => {
    const light = [50, 50, 50, 0]; // logits: white, half opaque
    const head = [-0.5, 0.5].flatMap((aside) => [aside, 0, 2, 1, 0, 0, 0, 0.1, 0.1, 0.1, 0, ...light, 0]);
    const one = new Rasteriser(await makeKernel());
    one.put(0, { kind: 'head', count: 2, rows: Float32Array.from(head).buffer, sizes: [0, 0] });
    const black = clothOf([0, 0, 0], WIDTH, HEIGHT);
    const view = Float32Array.of(1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0);
    const shine = (share: number, wide = 1, from = one, aside = 0) => {
      const placed = [{ id: 0, view, drawn: 2, values: new Float32Array(0), late: { first: 1, share, wide } }];
      const picture = from.draw({ lens: [100, 100, 100, 75], width: WIDTH, height: HEIGHT, band: [0, COLUMNS], placed }, black);
      return [75 + aside, 125 + aside].map((x) => picture[4 * (75 * TILE_WIDTH * COLUMNS + x)]!);
    };
    const [first, second] = shine(1);
    expect(first).toBeGreaterThan(100);
    expect(second).toBe(first);
    for (const share of [0.25, 0.5, 0]) {
      const [before, after] = shine(share);
      expect(before).toBe(first);
      expect(Math.abs(after! - share * first!)).toBeLessThanOrEqual(1);
    }
    const wider = new Rasteriser(await makeKernel());
    wider.put(0, { kind: 'head', count: 2, rows: Float32Array.from(head, (value, i) => ([7, 8, 9].includes(i) ? 2 * value : value)).buffer, sizes: [0, 0] });
    const aside = 8; // pixels
    expect(shine(0.5, 2, one, aside)).toEqual(shine(0.5, 1, wider, aside));
    expect(shine(0.5, 2, one, aside)).not.toEqual(shine(0.5, 1, one, aside));
  });

  test('moves the Gaussians of a head by their share of the motion of the shoulders', async () => {
    const light = [3, 1, -1, 2];
    const rows = (share: number) => Float32Array.of(0.3, -0.2, 2, 0.8, 0.1, 0.5, -0.3, 0.2, 0.05, 0.1, 0, ...light, share);
    const [angle, shift] = [0.3, [0.2, -0.1, 0.4]];
    const [cosine, sine] = [Math.cos(angle), Math.sin(angle)];
    const motion = Float32Array.of(Math.cos(angle / 2), 0, 0, Math.sin(angle / 2), ...shift);
    const still = Float32Array.of(1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0);
    const moved = Float32Array.of(cosine, -sine, 0, shift[0]!, sine, cosine, 0, shift[1]!, 0, 0, 1, shift[2]!);
    const draw = async (share: number, view: Float32Array) => {
      const one = new Rasteriser(await makeKernel());
      one.put(0, { kind: 'head', count: 1, rows: rows(share).buffer as ArrayBuffer, sizes: [0, 0] });
      const placed = [{ id: 0, view, drawn: 1, values: motion }];
      return one.draw({ lens: [100, 100, 100, 75], width: WIDTH, height: HEIGHT, band: [0, COLUMNS], placed }, background).slice();
    };
    const expected = await draw(0, moved);
    expect(worst(await draw(1, still), expected)).toBeLessThanOrEqual(1);
    expect(worst(await draw(0, still), expected)).toBeGreaterThan(30);
    expect(worst(await draw(0.5, still), expected)).toBeGreaterThan(30);
  });

  test('moves the Gaussians of a head by their displacements, and then with the shoulders', async () => {
    const light = [3, 1, -1, 2];
    const row = (x: number, y: number, z: number, share: number) => [x, y, z, 0.8, 0.1, 0.5, -0.3, 0.2, 0.05, 0.1, 0.01, ...light, share];
    const basis = [100, -50, 3, 7]; // of the logits
    const moves = [[50, -20, 100, 0], [-128, 127, 0, 0]]; // the fourth number has no meaning
    const bytes = (floats: number[], more: number[]) => {
      const rows = new Uint8Array(64 + more.length);
      rows.set(new Uint8Array(Float32Array.from(floats).buffer));
      rows.set(Int8Array.from(more), 64);
      return rows.buffer as ArrayBuffer;
    };
    const [steps, shoulders] = [[0.004, -0.001], [Math.cos(0.2), 0, Math.sin(0.2), 0, 0.1, 0, 0]];
    const [x, y, z] = [0.3, -0.2, 2];
    const by = [0, 1, 2].map((k) => steps[0]! * moves[0]![k]! + steps[1]! * moves[1]![k]!);
    const still = Float32Array.of(1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0);
    const draw = async (rows: ArrayBuffer, sizes: number[], values: number[]) => {
      const one = new Rasteriser(await makeKernel());
      one.put(0, { kind: 'head', count: 1, rows, sizes });
      const placed = [{ id: 0, view: still, drawn: 1, values: Float32Array.from(values) }];
      return one.draw({ lens: [100, 100, 100, 75], width: WIDTH, height: HEIGHT, band: [0, COLUMNS], placed }, background).slice();
    };
    for (const share of [0, 0.5]) {
      const moving = bytes(row(x, y, z, share), [...basis, ...moves.flat()]);
      const there = bytes(row(x + by[0]!, y + by[1]!, z + by[2]!, share), basis);
      const expected = await draw(there, [1, 0], [0.7, ...shoulders]);
      expect(worst(await draw(moving, [1, 2], [0.7, ...steps, ...shoulders]), expected)).toBeLessThanOrEqual(1);
      expect(worst(await draw(moving, [1, 2], [0.7, 0, 0, ...shoulders]), expected)).toBeGreaterThan(30);
    }
  });

  test('draws where the background changed anew, and nothing else', async () => {
    const [keeping, fresh] = [new Rasteriser(await makeKernel()), new Rasteriser(await makeKernel())];
    for (const one of [keeping, fresh]) one.put(0, reference.source);
    const shadow = (middle: number) =>
      clothOf((x, y) => reference.background.map((value) => value * (1 - 0.5 * Math.exp(-(((x - middle) / 20) ** 2) - ((y - 130) / 10) ** 2))), WIDTH, HEIGHT);
    const wanted = frame(0, COLUMNS, 1000);
    keeping.draw(wanted, shadow(100));
    for (const middle of [101, 108, 60]) {
      const picture = keeping.draw(wanted, shadow(middle));
      expect(keeping.drawnTiles).toBeGreaterThan(5);
      expect(keeping.drawnTiles).toBeLessThan(COLUMNS * 2); // of three rows of tiles
      fresh.forget();
      expect(worst(picture, fresh.draw(wanted, shadow(middle)))).toBe(0);
      keeping.draw(wanted, shadow(middle)); // another one that looks the same
      expect(keeping.drawnTiles).toBe(0);
    }
  });

  test('shows the background where nothing is, straight between its colours', () => {
    const sloping = clothOf((x, y) => [x / 300, y / 200, 0.5], WIDTH, HEIGHT);
    const picture = rasteriser.draw(frame(0, COLUMNS, 0), sloping);
    const sums = [0, 0, 0];
    let most = 0; // levels by which a pixel is off
    for (let i = 0; i < WIDTH * HEIGHT; i++) {
      const [x, y] = [i % WIDTH, Math.floor(i / WIDTH)];
      const at = 4 * (TILE_WIDTH * COLUMNS * y + x);
      for (const [k, value] of [(255 * x) / 300, (255 * y) / 200, 127.5].entries()) {
        const off = picture[at + k]! - value;
        most = Math.max(most, Math.abs(off), 255 - picture[at + 3]!);
        sums[k]! += off;
      }
    }
    expect(most).toBeLessThan(1.001); // a level at most, by the noise
    for (const sum of sums) expect(Math.abs(sum) / (WIDTH * HEIGHT)).toBeLessThan(0.02); // which adds nothing on the whole
  });
});
