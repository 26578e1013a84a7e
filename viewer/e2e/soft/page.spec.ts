import type { Page } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, test } from 'vitest';
import { Browser } from '../../support/browser/browser.ts';
import { stillPerson } from '../../support/browser/drawing.ts';
import { lookAsBundled, psnr } from '../../support/browser/pictures.ts';
import { makePerson } from '../../support/references/person.ts';
import { servePage } from '../../support/servers/static.ts';

const WIDTH = 240;
const HEIGHT = 320;
const TIMES = [0, 2.4];
const person = makePerson({ gaussians: '300,450', times: TIMES, pictures: `${WIDTH}x${HEIGHT}` });

/** What the canvas shows: (H, W, 3). */
async function shownPixels(page: Page): Promise<Uint8Array> {
  const encoded = await page.evaluate(() => {
    const canvas = document.querySelector<HTMLCanvasElement>('#stage')!;
    const { data } = canvas.getContext('2d')!.getImageData(0, 0, canvas.width, canvas.height);
    return btoa(data.reduce((text, value) => text + String.fromCharCode(value), ''));
  });
  return new Uint8Array(Buffer.from(encoded, 'base64')).filter((_, at) => at % 4 < 3);
}

describe('a page that draws without WebGL', () => {
  let server: Awaited<ReturnType<typeof servePage>>;
  let browser: Browser;
  let page: Page;
  beforeAll(async () => {
    server = await servePage(person.folder);
    browser = await Browser.launch({ width: WIDTH, height: HEIGHT });
    await browser.context.addInitScript(() => {
      // A browser that has none.
      const { getContext } = HTMLCanvasElement.prototype;
      HTMLCanvasElement.prototype.getContext = function (this: HTMLCanvasElement, kind: string, ...rest: unknown[]) {
        return kind.startsWith('webgl') ? null : (getContext as (...given: unknown[]) => unknown).call(this, kind, ...rest);
      } as typeof getContext;
    });
    page = await browser.open(`${server.url}?draw=soft`);
  });
  afterAll(async () => {
    await browser?.close();
    server?.close();
  });

  test('shows a person as Python draws it, before what is behind it', async () => {
    await lookAsBundled(page, person.folder);
    for (const [i, time] of TIMES.entries()) {
      await stillPerson(page, time);
      const picture = person.pictures!.subarray(3 * WIDTH * HEIGHT * i, 3 * WIDTH * HEIGHT * (i + 1));
      const likeness = psnr(await shownPixels(page), picture);
      console.log(`${time} s: ${likeness.toFixed(1)} dB`);
      expect(likeness).toBeGreaterThan(45);
    }
  });

  test('goes on while she moves, and says what it drew', async () => {
    await page.evaluate(() => {
      const { stage, head } = window.ico3d!;
      let value = 0;
      head!.director = { expression: (out) => ((out[0] = value = (value + 0.1) % 1), true) };
      stage.start();
    });
    const before = await page.evaluate(() => window.ico3d!.stage.frames);
    await page.waitForFunction((frames) => window.ico3d!.stage.frames > frames + 10, before);
    const figures = await page.evaluate(() => window.ico3d!.stage.figures);
    expect(figures.pixels).toEqual([WIDTH, HEIGHT]);
    expect(figures.gaussians).toBeGreaterThan(300);
  });
});
