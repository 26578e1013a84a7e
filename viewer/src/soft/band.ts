import { makeKernel } from './kernel.ts';
import { Rasteriser, type Cloth, type Frame, type Part, type Steps } from './rasteriser.ts';
import type { Source } from './source.ts';
import { TILE_WIDTH } from './tiles.ts';

/** What a worker is told. */
export type Order = { put: number; source: Source } | { frame: Frame; cloth: Cloth | null; sharpness: number };

/** A band that was drawn. */
export interface Drawn {
  part: Part | null; // that is to be shown anew
  pixels: ArrayBuffer; // RGBA of it
  took: number; // ms
  steps: Steps;
  gaussians: number;
}

/** Draws bands of pictures, and keeps what is behind them. */
export class BandPainter {
  private readonly kernel: Awaited<ReturnType<typeof makeKernel>>;
  private readonly rasteriser: Rasteriser;
  private cloth: Cloth | null = null;

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

  /**
   * @param cloth another one than before, null for the same
   * @param sharpness amount by which it is sharpened, see `Rasteriser.take`
   */
  draw(frame: Frame, cloth: Cloth | null, sharpness: number): Drawn {
    const before = performance.now();
    if (cloth) this.cloth = cloth;
    const wide = sharpness ? widened(frame) : frame;
    this.rasteriser.draw(wide, this.cloth!);
    const part = shownPart(frame, this.rasteriser.changed(wide), sharpness ? 1 : 0);
    const pixels = part ? this.rasteriser.take(wide, part, sharpness).slice().buffer : new ArrayBuffer(0);
    return { part, pixels, took: performance.now() - before, steps: this.rasteriser.steps, gaussians: this.kernel.seen() };
  }
}

/** With the neighbours of the band, which its outermost pixels are sharpened by. */
function widened(frame: Frame): Frame {
  const [first, end] = frame.band;
  return { ...frame, band: [Math.max(0, first - 1), Math.min(Math.ceil(frame.width / TILE_WIDTH), end + 1)] };
}

/** The part of a band that looks another way than before, where what changed reaches so far around itself. */
function shownPart({ height, band: [first, end] }: Frame, changed: Part | null, reach: number): Part | null {
  if (!changed) return null;
  const { columns, rows } = changed;
  const [left, right] = [Math.max(first, columns[0] - reach), Math.min(end, columns[1] + reach)];
  if (left >= right) return null;
  return { columns: [left, right], rows: [Math.max(0, rows[0] - reach), Math.min(height, rows[1] + reach)] };
}
