import type { Actor } from '../../actor.ts';
import { Generator } from '../../gaussians/generator.ts';
import type { SoftObject } from '../../soft/source.ts';
import { readSplats, type SplatFile } from './file.ts';
import { sourceOf } from './rows.ts';

/** The splats behind the person for whatever draws them; the processor reads them here, Spark the file. */
export class StillGenerator extends Generator {
  /** How many are drawn, the largest ones first: a share of all. */
  share = 1;
  readonly file: SplatFile;
  readonly soft: SoftObject & { drawn: number };

  /** @param rows of the file's splats */
  constructor(file: SplatFile, rows: Float32Array) {
    const source = sourceOf(rows);
    super(source.count);
    this.file = file;
    this.soft = { source, drawn: source.count, values: new Float32Array(0) };
  }

  thin(share: number): void {
    this.share = share;
    this.soft.drawn = Math.ceil(share * this.numSplats);
    this.changed();
  }
}

/** Reads the splats behind the person without Spark; null for a kind of file that only Spark reads. */
export async function makeStillBackdrop(file: SplatFile): Promise<Actor | null> {
  const rows = await readSplats(file);
  if (!rows) return null;
  const generator = new StillGenerator(file, rows);
  return { objects: [generator], tick: () => false, thin: (share) => generator.thin(share) };
}
