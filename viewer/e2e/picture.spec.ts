import { afterAll, beforeAll, describe, expect, test } from 'vitest';
import { Browser } from '../support/browser/browser.ts';
import { drawnBy } from '../support/browser/path.ts';
import { lookAsBundled, psnr, takeStill, worst } from '../support/browser/pictures.ts';
import { makeReference } from '../support/references/head.ts';
import { servePage } from '../support/servers/static.ts';

const WIDTH = 320;
const HEIGHT = 240;
const reference = makeReference({ gaussians: 4000, pictures: `${WIDTH}x${HEIGHT}`, shoulders: true });
const pixels = 3 * WIDTH * HEIGHT;
const values = reference.attributes.length / reference.expressions.length;

describe('what the GPU makes of a bundle', () => {
  let server: Awaited<ReturnType<typeof servePage>>;
  let browser: Browser;

  beforeAll(async () => {
    server = await servePage(reference.folder);
    browser = await Browser.launch({ width: WIDTH, height: HEIGHT });
    await lookAsBundled(await browser.open(drawnBy('webgl', server.url)), reference.folder);
  });

  afterAll(async () => {
    await browser?.close();
    server?.close();
  });

  test.each(reference.expressions.map((row, i) => [i, row] as const))(
    'expression %i is what Python makes of it',
    async (i, row) => {
      const still = await takeStill(browser.page, row);
      expect(worst(still.coefficients, reference.coefficients[i]!)).toBeLessThan(1e-4);
      const truth = reference.attributes.subarray(i * values, (i + 1) * values);
      expect(worst(still.attributes, truth)).toBeLessThan(1 / 255);
      const picture = reference.pictures!.subarray(i * pixels, (i + 1) * pixels);
      expect(psnr(still.pixels, picture)).toBeGreaterThan(40);
    },
  );

  test('arrow keys walk around it, Home returns', async () => {
    const { page } = browser;
    const angle = () =>
      page.evaluate(() => {
        const { position } = window.ico3d!.stage.orbit.camera;
        return (Math.atan2(position.x, position.z) * 180) / Math.PI;
      });
    await page.focus('#stage');
    for (let i = 0; i < 3; i++) await page.keyboard.press('ArrowLeft');
    expect(Math.abs(await angle())).toBeCloseTo(12, 1);
    for (let i = 0; i < 40; i++) await page.keyboard.press('ArrowLeft');
    expect(Math.abs(await angle())).toBeCloseTo(75, 1); // the limit
    await page.evaluate(() => window.ico3d!.stage.start());
    await page.keyboard.press('Home');
    await expect.poll(angle).toBeCloseTo(0, 0);
  });

  test('a damaged file is one sentence on the page', async () => {
    const { page } = browser;
    await page.route('**/head.safetensors*', (route) => route.fulfill({ body: 'x'.repeat(100) }));
    await page.reload();
    const sentence = page.locator('#overlay-error');
    await sentence.waitFor();
    expect(await sentence.textContent()).toBe('head.safetensors is shorter than manifest.json says.');
  });
});
