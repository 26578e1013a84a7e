import { afterAll, afterEach, beforeAll, beforeEach, expect, test } from 'vitest';
import { Browser } from '../../support/browser/browser.ts';
import { feed, noise } from '../../support/sound/feeder.ts';
import { drawnBy } from '../../support/browser/path.ts';
import { lookAsBundled } from '../../support/browser/pictures.ts';
import { runPython } from '../../support/python.ts';
import { scratchFolder } from '../../support/scratch.ts';
import { servePage } from '../../support/servers/static.ts';
import { ms, quantile } from '../../support/statistics.ts';
import { comparePlacement, tap } from '../../support/sound/tap.ts';

const RATE = 24_000;
const TICK = 1 / 30;
const SECONDS = 30;
const SIZE = 128; // pixels; in much smaller windows Chromium draws once a second

let server: Awaited<ReturnType<typeof servePage>>;
let browser: Browser;
const folder = scratchFolder();

beforeAll(async () => {
  runPython('references/phase_bundle.py', folder);
  server = await servePage(folder);
});

beforeEach(async () => {
  browser = await Browser.launch({ width: SIZE, height: SIZE });
  await lookAsBundled(await browser.open(drawnBy('webgl', server.url)), folder);
  await browser.page.evaluate(`window.noise = ${noise.toString()}`);
  await tap(browser.page);
  await watch();
});

afterEach(() => browser?.close());
afterAll(() => server?.close());

interface Sight {
  frame: number; // of the audio clock, as heard when the picture was drawn
  phase: number; // of the second, read from the picture's colour
}

/** Reads the colour of every picture the page draws and when, on the audio clock, it was drawn. */
function watch(): Promise<void> {
  return browser.page.evaluate(() => {
    const { stage, conversation } = window.ico3d!;
    const { context } = conversation!.player;
    const gl = stage.renderer.getContext();
    const draw = stage.draw.bind(stage);
    const sights: Sight[] = [];
    Object.assign(window, { sights });
    stage.draw = () => {
      draw();
      const { contextTime, performanceTime } = context.getOutputTimestamp();
      const heard = contextTime! + (performance.now() - performanceTime!) / 1000;
      const pixel = new Uint8Array(4);
      gl.readPixels(64, 64, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
      const logit = (value: number) => Math.log(value / (255 - value));
      const phase = Math.atan2(logit(pixel[1]!), logit(pixel[0]!)) / (2 * Math.PI);
      sights.push({ frame: heard * 24000, phase });
    };
  });
}

test(`over ${SECONDS} s every sample is where it belongs and the face stays with it`, { retry: 2 }, async () => {
  // again where the machine stood still for longer than pieces come ahead: what is wrong with the page is wrong each time
  const { page } = browser;
  await feed(page, 0, SECONDS);
  await page.waitForTimeout(1000 * (SECONDS + 2));
  // Sound: each sample of the noise lies on the frame that was asked for, and pieces join.
  const { pieces, begin, wrong, unseen, shifted } = await comparePlacement(page);
  expect({ wrong, shifted }).toEqual({ wrong: 0, shifted: 0 });
  expect(unseen / (SECONDS * RATE)).toBeLessThan(0.05);
  expect(pieces).toBeGreaterThan(300); // as many as the server makes of a minute

  // Face: what each picture shows against what is heard when it is drawn.
  const sights = await page.evaluate(() => (window as unknown as { sights: Sight[] }).sights);
  const errors = sights
    .map(({ frame, phase }) => ({ time: (frame - begin) / RATE, phase }))
    .filter(({ time }) => time > 0.5 && time < SECONDS - 0.1)
    .map(({ time, phase }) => ({ time, error: ((((phase - time) % 1) + 1.5) % 1) - 0.5 }));
  const sorted = errors.map(({ error }) => Math.abs(error)).sort((a, b) => a - b);
  const middle = (from: number, to: number) => quantile(errors.filter(({ time }) => time >= from && time < to).map(({ error }) => error), 0.5);
  const drift = (middle(SECONDS / 2, SECONDS) - middle(0, SECONDS / 2)) / (SECONDS / 2); // medians: a picture that came late is no drift
  console.log(
    `${errors.length} pictures: face − sound median ${ms(sorted[sorted.length >> 1]!)}, ` +
      `95 % within ${ms(sorted[Math.floor(0.95 * sorted.length)]!)}, drift ${ms(drift * 60)} a minute; ` +
      `${wrong} of ${SECONDS * RATE} samples off, ${unseen} unseen, ${pieces} pieces`,
  );
  expect(errors.length).toBeGreaterThan(480);
  expect(sorted[Math.floor(0.95 * sorted.length)]).toBeLessThan(TICK);
  expect(Math.abs(drift)).toBeLessThan(1e-4);
});

test('stop is silence within 30 ms, and what comes later of that utterance is dropped', async () => {
  const { page } = browser;
  await feed(page, 1, 4);
  await page.waitForTimeout(1200);
  const stopped = await page.evaluate(() => {
    const { player } = window.ico3d!.conversation!;
    player.stop(1);
    return player.context.currentTime;
  });
  await page.waitForTimeout(1500);
  const { before, after } = await page.evaluate((time) => {
    const { first, samples } = window.tapped!;
    const at = Math.round(time * 24000) - first;
    const before = samples.slice(at - 2400, at).every((value) => value !== 0);
    return { before, after: samples.findLastIndex((value) => Math.abs(value) > 0) - at };
  }, stopped);
  expect(before).toBe(true);
  expect(after / RATE).toBeLessThan(0.03);
  expect(await page.evaluate(() => window.ico3d!.conversation!.player.current)).toBeNull();
});
