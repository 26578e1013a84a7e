import { describe, expect, test } from 'vitest';
import { BandPainter, type Drawn } from '../../src/soft/band.ts';
import type { Cloth, Frame } from '../../src/soft/rasteriser.ts';
import { TILE_WIDTH } from '../../src/soft/tiles.ts';
import { psnr, worst } from '../../support/browser/pictures.ts';
import { makeGaussians } from '../../support/references/gaussians/reference.ts';

const [WIDTH, HEIGHT] = [240, 160];
const SHARPNESS = 13; // 64ths

const reference = makeGaussians({ gaussians: 2000, size: `${WIDTH}x${HEIGHT}` });

/** What is behind: one colour everywhere. */
const cloth: Cloth = { step: 1000, columns: 2, colours: new Float32Array(12).fill(0.5) };

/** A picture of a share of the pixels along a side, moved aside by some metres. */
function frameOf(share: number, aside = 0): Frame {
  const [width, height] = [WIDTH * share, HEIGHT * share];
  const view = reference.view.map((value, i) => value + (i === 3 ? aside : 0));
  const placed = [{ id: 0, view, drawn: reference.source.count, values: new Float32Array(0) }];
  const [fx, fy, cx, cy] = reference.lens;
  return { lens: [fx * share, fy * share, cx * share, cy * share], width, height, band: [0, width / TILE_WIDTH], placed };
}

async function makePainter(): Promise<BandPainter> {
  const painter = await BandPainter.make();
  painter.put(0, reference.source);
  return painter;
}

/** Puts a part onto a canvas (H, W, 4). */
function show({ part, pixels }: Drawn, canvas: Uint8Array, width: number): void {
  if (!part) return;
  const { columns: [left, right], rows: [top, bottom] } = part;
  const across = 4 * TILE_WIDTH * (right - left);
  for (let y = top; y < bottom; y++) canvas.set(new Uint8Array(pixels, across * (y - top), across), 4 * (y * width + TILE_WIDTH * left));
}

/** A whole picture, drawn anew. */
async function fresh(frame: Frame, sharpness: number): Promise<Uint8Array> {
  const canvas = new Uint8Array(4 * frame.width * frame.height);
  show((await makePainter()).draw(frame, cloth, sharpness), canvas, frame.width);
  return canvas;
}

/** The picture in the size of the screen, straight between pixels, as browsers enlarge: (HEIGHT, WIDTH, 3). */
function enlarged(picture: Uint8Array, width: number, height: number): Uint8Array {
  const out = new Uint8Array(3 * WIDTH * HEIGHT);
  const between = (place: number, count: number) => {
    const at = Math.min(Math.max(place, 0), count - 1);
    return [Math.floor(at), Math.min(Math.floor(at) + 1, count - 1), at % 1] as const;
  };
  for (let i = 0; i < out.length; i++) {
    const [x0, x1, across] = between(((Math.floor(i / 3) % WIDTH) + 0.5) * (width / WIDTH) - 0.5, width);
    const [y0, y1, down] = between((Math.floor(i / 3 / WIDTH) + 0.5) * (height / HEIGHT) - 0.5, height);
    const value = (x: number, y: number) => picture[4 * (y * width + x) + (i % 3)]!;
    const [above, below] = [y0, y1].map((y) => value(x0, y) + across * (value(x1, y) - value(x0, y)));
    out[i] = Math.round(above! + down * (below! - above!));
  }
  return out;
}

describe('what is shown of a band', () => {
  test('is sharpened by its neighbours', async () => {
    const frame = frameOf(1);
    const [plain, sharp] = [await fresh(frame, 0), await fresh(frame, SHARPNESS)];
    const value = (x: number, y: number, channel: number) =>
      plain[4 * (Math.min(Math.max(y, 0), HEIGHT - 1) * WIDTH + Math.min(Math.max(x, 0), WIDTH - 1)) + channel]!;
    const expected = plain.map((here, i) => {
      const [x, y, channel] = [(i >> 2) % WIDTH, Math.floor(i / 4 / WIDTH), i & 3];
      const around = value(x - 1, y, channel) + value(x + 1, y, channel) + value(x, y - 1, channel) + value(x, y + 1, channel);
      return Math.min(Math.max(here + ((SHARPNESS * (4 * here - around) + 32) >> 6), 0), 255);
    });
    expect(worst(sharp, expected)).toBe(0);
    expect(worst(sharp, plain)).toBeGreaterThan(10);
  });

  test.each([0, SHARPNESS])('joins to the picture drawn in one and anew, to the bit (sharpness %i)', async (sharpness) => {
    const painters = [await makePainter(), await makePainter()];
    const canvas = new Uint8Array(4 * WIDTH * HEIGHT);
    const columns = WIDTH / TILE_WIDTH;
    const bands: Frame['band'][] = [[0, 23], [23, columns]];
    let least = Infinity;
    for (const [i, [aside, drawn]] of ([[0, 2000], [0, 1999], [0.01, 1999], [0.01, 1999], [0.01, 1980]] as const).entries()) {
      const frame = frameOf(1, aside);
      frame.placed[0]!.drawn = drawn;
      for (const [k, painter] of painters.entries()) {
        const band = painter.draw({ ...frame, band: bands[k]! }, i ? null : cloth, sharpness);
        least = Math.min(least, band.pixels.byteLength);
        show(band, canvas, WIDTH);
      }
      expect(worst(canvas, await fresh(frame, sharpness)), `picture ${i}`).toBe(0);
    }
    expect(least).toBe(0); // where nothing changes nothing is sent
  });

  test('comes nearer to a fine picture when it is enlarged', async () => {
    const fine = (await fresh(frameOf(1), 0)).filter((_, at) => at % 4 < 3);
    const frame = frameOf(0.65);
    const [plain, sharp] = await Promise.all([0, SHARPNESS].map(async (sharpness) => psnr(enlarged(await fresh(frame, sharpness), frame.width, frame.height), fine)));
    console.log(`${plain!.toFixed(1)} dB, sharpened ${sharp!.toFixed(1)} dB`);
    expect(sharp!).toBeGreaterThan(plain! + 2);
  });
});
