import { makeKernel } from './kernel.ts';
import { Rasteriser, type Frame } from './rasteriser.ts';
import type { Source } from './source.ts';
import { TILE_WIDTH } from './tiles.ts';

/** What is behind everybody: colours at every so many pixels, between which they go straight. */
export interface Cloth {
  step: number; // pixels
  columns: number;
  colours: Float32Array; // (rows, columns, 3) display values
}

/** What a worker is told. */
export type Order = { put: number; source: Source } | { frame: Frame; cloth: Cloth | null };

/** A band that was drawn. */
export interface Drawn {
  pixels: ArrayBuffer; // RGBA, as wide as its tiles
  took: number; // ms
  gaussians: number;
}

/** Draws bands of pictures, and keeps what is behind them. */
export class BandPainter {
  private readonly kernel: Awaited<ReturnType<typeof makeKernel>>;
  private readonly rasteriser: Rasteriser;
  private cloth: Cloth | null = null;
  private behind = { key: '', pixels: new Uint32Array(0) };

  private constructor(kernel: BandPainter['kernel']) {
    this.kernel = kernel;
    this.rasteriser = new Rasteriser(kernel);
  }

  static async make(): Promise<BandPainter> {
    return new BandPainter(await makeKernel());
  }

  put(id: number, source: Source): void {
    this.rasteriser.put(id, source);
  }

  /** @param cloth another one than before, null for the same */
  draw(frame: Frame, cloth: Cloth | null): Drawn {
    const before = performance.now();
    if (cloth) {
      this.cloth = cloth;
      this.behind.key = '';
    }
    const key = [frame.height, ...frame.band].join();
    if (key !== this.behind.key) this.behind = { key, pixels: spread(this.cloth!, frame) };
    const drawn = this.rasteriser.draw(frame, this.behind.pixels);
    const pixels = drawn.slice().buffer;
    return { pixels, took: performance.now() - before, gaussians: this.kernel.seen() };
  }
}

/** The pixels of a band of a cloth; noise of half a level hides the steps between colours. */
export function spread({ step, columns, colours }: Cloth, { height, band: [first, end] }: Pick<Frame, 'height' | 'band'>): Uint32Array<ArrayBuffer> {
  const width = TILE_WIDTH * (end - first);
  const pixels = new Uint32Array(width * height);
  for (let y = 0; y < height; y++) {
    const row = Math.floor(y / step);
    const down = y / step - row;
    for (let x = 0; x < width; x++) {
      const place = (x + TILE_WIDTH * first) / step;
      const column = Math.floor(place);
      const aside = place - column;
      const at = 3 * (columns * row + column);
      const part = 52.9829189 * ((0.06711056 * (x + TILE_WIDTH * first) + 0.00583715 * y) % 1);
      const noise = part - Math.floor(part); // and half a level less, and half a level more to round
      let pixel = 0xff000000;
      for (let channel = 0; channel < 3; channel++) {
        const here = at + channel;
        const above = colours[here]! + aside * (colours[here + 3]! - colours[here]!);
        const below = colours[here + 3 * columns]! + aside * (colours[here + 3 * columns + 3]! - colours[here + 3 * columns]!);
        const level = Math.floor(255 * (above + down * (below - above)) + noise);
        pixel |= Math.min(Math.max(level, 0), 255) << (8 * channel);
      }
      pixels[y * width + x] = pixel;
    }
  }
  return pixels;
}
