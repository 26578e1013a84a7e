import type { Page } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, test } from 'vitest';
import { Browser } from '../support/browser/browser.ts';
import { stillPerson } from '../support/browser/drawing.ts';
import { drawnBy, withoutWebGL } from '../support/browser/path.ts';
import { lookAsBundled, psnr, shownPixels, takePixels } from '../support/browser/pictures.ts';
import { makePerson } from '../support/references/person.ts';
import { servePage } from '../support/servers/static.ts';

const GAUSSIANS = 1200; // of the head, and of the body
const FIRST = 30_000; // bytes
const STEPS = 6; // pictures while finer Gaussians appear
const { folder } = makePerson({ body: 'skinned', gaussians: `${GAUSSIANS},${GAUSSIANS}`, first: FIRST });

let site: Awaited<ReturnType<typeof servePage>>;
let browser: Browser;
let page: Page;
let release: () => void;

beforeAll(async () => {
  site = await servePage(folder);
  browser = await Browser.launch({ width: 120, height: 160, calm: true });
  page = browser.page;
  const held = new Promise<void>((resolve) => (release = resolve));
  await holdRest(page, held);
  await browser.open(drawnBy('webgl', site.url));
  await page.evaluate(() => window.ico3d!.stage.still());
});

afterAll(async () => {
  await browser?.close();
  site?.close();
});

/** Lets a page have the first Gaussians only until a promise is kept. */
async function holdRest(page: Page, held: Promise<void>): Promise<void> {
  await page.route('**/*_rest.safetensors*', async (route) => {
    await held;
    await route.continue();
  });
}

/** Gaussians of head and body that the picture shows, and what it looks like. */
async function look(): Promise<{ drawn: number[]; pixels: Buffer | Uint8Array }> {
  await page.evaluate(() => window.ico3d!.stage.still());
  const drawn = await page.evaluate(() => {
    const { head, skinned, splats } = window.ico3d!;
    return [head!.generator, skinned!.generator].map((generator) => splats(generator).rgba.filter((value, i) => i % 4 === 3 && value > 0).length);
  });
  return { drawn, pixels: await takePixels(page) };
}

describe('a person whose Gaussians come in two files', () => {
  test('is the same with WebGL and without it while the first ones stand alone', async () => {
    const other = await Browser.launch({ width: 120, height: 160, calm: true });
    await withoutWebGL(other.context);
    await holdRest(other.page, new Promise(() => {}));
    await other.open(drawnBy('soft', site.url));
    for (const one of [page, other.page]) {
      await lookAsBundled(one, folder);
      await stillPerson(one, 0);
    }
    const likeness = psnr(await shownPixels(other.page), await takePixels(page));
    console.log(`${likeness.toFixed(1)} dB`);
    expect(likeness).toBeGreaterThan(40);
    await other.close();
  });

  test('is seen from the first ones, and becomes finer without a jump when the others come', async () => {
    const coarse = await look();
    for (const count of coarse.drawn) {
      expect(count).toBeGreaterThan(50);
      expect(count).toBeLessThan(0.6 * GAUSSIANS);
    }
    const capacity = await page.evaluate(() => [window.ico3d!.head!.generator, window.ico3d!.skinned!.generator].map(({ numSplats }) => numSplats));
    expect(capacity).toEqual([GAUSSIANS, GAUSSIANS]);

    const arrived = page.waitForFunction(() => {
      const { head, skinned } = window.ico3d!;
      return [head!, skinned!].every((actor) => actor.whole);
    });
    release();
    await arrived;
    const before = await look();
    expect(before.drawn, 'what has come is not seen at once').toEqual(coarse.drawn);

    const looks = [before];
    for (let step = 0; step < STEPS; step++) {
      await page.evaluate((seconds) => {
        const { head, skinned } = window.ico3d!;
        skinned!.tick(seconds);
        head!.tick(seconds);
      }, 0.12);
      looks.push(await look());
    }
    const fine = looks.at(-1)!;
    expect(Math.min(...fine.drawn)).toBeGreaterThan(0.95 * GAUSSIANS);
    const change = (a: number, b: number) => 10 ** (-psnr(looks[a]!.pixels, looks[b]!.pixels) / 20); // root mean square
    const whole = change(0, STEPS);
    const steps = Array.from({ length: STEPS }, (_, i) => change(i, i + 1));
    console.log(`${coarse.drawn} of ${fine.drawn} Gaussians first; changes ${steps.map((s) => (s / whole).toFixed(2))} of the whole one`);
    expect(whole).toBeGreaterThan(0.005);
    expect(Math.max(...steps)).toBeLessThan(0.6 * whole);
  });
});
