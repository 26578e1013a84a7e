import { statSync } from 'node:fs';
import { join } from 'node:path';
import type { Page } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, test } from 'vitest';
import { Browser } from '../../support/browser/browser.ts';
import { stillPerson } from '../../support/browser/drawing.ts';
import { drawnBy, withoutWebGL } from '../../support/browser/path.ts';
import { lookAsBundled, psnr, shownPixels, takePixels } from '../../support/browser/pictures.ts';
import { REPOSITORY } from '../../support/python.ts';
import { makePerson } from '../../support/references/person.ts';
import { servePage } from '../../support/servers/static.ts';

const WIDTH = 240;
const HEIGHT = 320;
const TIMES = [0, 2.4];
const MOST_BYTES = 60_000; // of the scripts that draw without WebGL, compressed
const MOVING = [0, 0.04, 0.08, 0.12]; // s
const person = makePerson({ gaussians: '300,450', times: TIMES, pictures: `${WIDTH}x${HEIGHT}` });

/** The scripts that a page has loaded. */
function scripts(page: Page): Promise<string[]> {
  return page.evaluate(() => performance.getEntriesByType('resource').map(({ name }) => name.split('/').at(-1)!).filter((name) => name.endsWith('.js')));
}

/** Goes on to a moment, with another face, over what is shown; Spark sorts before. */
async function strike(page: Page, time: number): Promise<void> {
  await page.evaluate(async (seconds) => {
    const { stage, body, head } = window.ico3d!;
    await body!.show(seconds);
    head!.express(Float32Array.from(head!.expression, (_, i) => 0.5 * Math.sin(i + 20 * seconds)));
    await stage.painter.settle(stage.scene, stage.camera);
    stage.draw();
    await stage.painter.shown();
  }, time);
}

describe('a page that draws without WebGL', () => {
  let server: Awaited<ReturnType<typeof servePage>>;
  let browser: Browser;
  let page: Page;
  beforeAll(async () => {
    server = await servePage(person.folder);
    browser = await Browser.launch({ width: WIDTH, height: HEIGHT });
    await withoutWebGL(browser.context);
    page = await browser.open(drawnBy('soft', server.url));
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

  test('shows what Spark shows at the same moments of a movement', async () => {
    const other = await Browser.launch({ width: WIDTH, height: HEIGHT });
    await other.open(drawnBy('webgl', server.url));
    for (const one of [page, other.page]) {
      await lookAsBundled(one, person.folder);
      await one.evaluate(() => {
        window.ico3d!.head!.director = null;
        window.ico3d!.stage.scenery.visible = false;
        window.ico3d!.stage.start();
      });
    }
    const pictures: Uint8Array[] = [];
    for (const time of MOVING) {
      for (const one of [page, other.page]) await strike(one, time);
      const [shown, spark] = [await shownPixels(page), await takePixels(other.page)];
      const likeness = psnr(shown, spark);
      console.log(`${time} s: ${likeness.toFixed(1)} dB`);
      expect(likeness, `${time} s`).toBeGreaterThan(40);
      pictures.push(shown);
    }
    expect(psnr(pictures[0]!, pictures.at(-1)!)).toBeLessThan(40);
    const theirs = await scripts(other.page);
    const own = (await scripts(page)).filter((name) => !theirs.includes(name));
    const bytes = own.reduce((sum, name) => sum + statSync(join(REPOSITORY, `src/ico3d/chat/static/assets/${name}.gz`)).size, 0);
    console.log(`${own.join()}: ${(bytes / 1000).toFixed(1)} kB compressed, loaded only here`);
    expect(bytes).toBeGreaterThan(5000);
    expect(bytes).toBeLessThan(MOST_BYTES);
    await other.close();
    await page.evaluate(() => (window.ico3d!.stage.scenery.visible = true));
  });

  test('reads what is behind a person without Spark, which gets it when it takes over', async () => {
    expect((await scripts(page)).filter((name) => /spark|webgl/.test(name))).toEqual([]);
    const other = await Browser.launch({ width: WIDTH, height: HEIGHT });
    await other.open(drawnBy('soft', server.url));
    await lookAsBundled(other.page, person.folder);
    await stillPerson(other.page, TIMES[0]!);
    const shown = await shownPixels(other.page);
    await other.page.evaluate(() => {
      window.ico3d!.stage.start();
      const select = document.querySelector<HTMLSelectElement>('#draw')!;
      select.value = 'webgl';
      select.dispatchEvent(new Event('change'));
    });
    await other.page.waitForFunction(() => window.ico3d!.stage.painter.path === 'webgl' && document.querySelectorAll('.picture').length === 1);
    await stillPerson(other.page, TIMES[0]!);
    const spark = await takePixels(other.page);
    console.log(`${psnr(shown, spark).toFixed(1)} dB`);
    expect(psnr(shown, spark)).toBeGreaterThan(40);
    const [all, few] = await other.page.evaluate(async () => {
      const { stage, backdrop } = window.ico3d!;
      const before = stage.figures.gaussians;
      backdrop!.thin!(0.2);
      await stage.still();
      return [before, stage.figures.gaussians];
    });
    expect(few!).toBeLessThan(all! - 10);
    await other.close();
  });

  test('draws moving pictures as coarsely as must be, and one at rest as fine as can be', async () => {
    await page.evaluate(() => {
      const { stage, head } = window.ico3d!;
      head!.director = null;
      stage.start();
      stage.holdQuality(stage.figures.levels - 1);
    });
    const across = (width: number) => page.waitForFunction((wanted) => document.querySelector<HTMLCanvasElement>('#stage')!.width === wanted, width);
    await across(WIDTH);
    await page.evaluate(() => {
      let value = 0;
      window.ico3d!.head!.director = { expression: (out) => ((out[0] = value = (value + 0.1) % 1), true) };
    });
    await across(WIDTH / 2);
    await page.evaluate(() => (window.ico3d!.head!.director = null));
    await across(WIDTH);
    await page.evaluate(() => window.ico3d!.stage.holdQuality(0));
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
    const { project, bin, blend } = await page.evaluate(() => (window.ico3d!.stage.painter as unknown as { steps: Record<string, number> }).steps);
    expect(figures.draw).toBeGreaterThan(0.5 * (project! + bin! + blend!)); // what workers take, not what it takes to ask them
  });

  test('leaves the processor to whoever works out an answer', async () => {
    const most = 8; // pictures in a second, of which one may have been begun before
    const drawn = await page.evaluate(async () => {
      const { stage } = window.ico3d!;
      stage.spare(true);
      const [frames, begin] = [stage.frames, performance.now()];
      while (performance.now() - begin < 1000 || stage.frames === frames) await new Promise(requestAnimationFrame);
      const rate = (stage.frames - frames) / ((performance.now() - begin) / 1000);
      stage.spare(false);
      return rate;
    });
    expect(drawn).toBeGreaterThan(0);
    expect(drawn).toBeLessThan(most);
    const before = await page.evaluate(() => window.ico3d!.stage.frames);
    await page.waitForFunction((frames) => window.ico3d!.stage.frames > frames + 10, before);
  });
});
