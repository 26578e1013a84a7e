import { mkdirSync, writeFileSync } from 'node:fs';
import { dirname, join } from 'node:path';
import type { Page } from 'playwright-core';
import { Browser } from '../../support/browser/browser.ts';
import { REPOSITORY } from '../../support/python.ts';

const WIDTH = 1280; // pixels of a sheet
const MOST_BYTES = 150_000;
const [BEST, STEP, WORST] = [88, 6, 46]; // quality of JPEG

/** Pictures of one family of states, and the sheet of all of them that the documentation shows. */
export class Album {
  private readonly pictures: { caption: string; png: Buffer }[] = [];

  /** Takes what somebody sees of a page now. */
  async shoot(page: Page, caption: string): Promise<void> {
    this.add(await page.screenshot(), caption);
  }

  add(png: Buffer, caption: string): void {
    this.pictures.push({ caption, png });
    if (process.env.PICTURES) writeFileSync(join(process.env.PICTURES, `${caption.replaceAll(/\W+/g, '-')}.png`), png);
  }

  /**
   * Writes the sheet: rows of pictures of one height, each with its words under it.
   *
   * @param file of `docs/images`
   * @param height of a picture in the sheet, pixels
   */
  async write(file: string, height: number): Promise<void> {
    const browser = await Browser.launch({ width: WIDTH, height: 100 });
    try {
      const figures = this.pictures.map(
        ({ caption, png }) => `<figure><img src="data:image/png;base64,${png.toString('base64')}"><figcaption>${caption}</figcaption></figure>`,
      );
      await browser.page.setContent(`<style>
        html { scrollbar-width: none }
        body { display: flex; flex-wrap: wrap; justify-content: center; gap: 10px; margin: 0; padding: 10px; background: #fff }
        figure { display: flex; flex-direction: column; margin: 0; min-width: 0 }
        img { height: ${height}px; max-width: ${WIDTH - 20}px; object-fit: contain }
        figcaption { width: 0; min-width: 100%; font: 13px/1.5 system-ui, sans-serif; text-align: center; color: #333 }
      </style>${figures.join('')}`);
      const path = join(REPOSITORY, 'docs/images', file);
      mkdirSync(dirname(path), { recursive: true });
      writeFileSync(path, await smallEnough(browser.page));
    } finally {
      await browser.close();
    }
  }
}

/**
 * Writes what somebody sees of a page now as a picture of its own.
 *
 * @param file of `docs/images`
 */
export async function publish(page: Page, file: string): Promise<void> {
  writeFileSync(join(REPOSITORY, 'docs/images', file), await smallEnough(page));
}

/** The page as a JPEG of the best quality that is small enough. */
async function smallEnough(page: Page): Promise<Buffer> {
  for (let quality = BEST; quality >= WORST; quality -= STEP) {
    const jpeg = await page.screenshot({ type: 'jpeg', quality, fullPage: true });
    if (jpeg.length <= MOST_BYTES) return jpeg;
  }
  throw new Error(`a sheet of pictures has more than ${MOST_BYTES} bytes: make it lower`);
}
