import type { Page } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, test } from 'vitest';
import { Browser } from '../support/browser/browser.ts';
import { makeBody } from '../support/references/body.ts';
import { playByPictures } from '../support/browser/drawing.ts';
import type { Playback } from '../src/motion/playback.ts';
import { drawnBy } from '../support/browser/path.ts';
import { psnr, takePixels, worst } from '../support/browser/pictures.ts';
import { ChatServer } from '../support/servers/server.ts';

const WIDTH = 120;
const HEIGHT = 160;
const TIMES = [0, 0.3, 1, 1.45, 2, 2.7, 3]; // borders among them
const reference = makeBody({ gaussians: 600, times: TIMES, pictures: `${WIDTH}x${HEIGHT}` });
const pixels = 3 * WIDTH * HEIGHT;

/** What a drawn picture showed of the body. */
interface Sight {
  at: number; // ms
  time: number;
  window: number;
  slot: number;
  waiting: boolean;
}

declare global {
  interface Window {
    sights?: Sight[];
    pictures?: Uint8Array[]; // of the sights
    picture?: () => Uint8Array; // draws now
    psnr?: (a: Uint8Array, b: Uint8Array) => number;
  }
}

let server: ChatServer;
let browser: Browser;
let page: Page;

beforeAll(async () => {
  server = await ChatServer.start(reference.file);
  browser = await Browser.launch({ width: WIDTH, height: HEIGHT, hertz: 60 });
  page = await browser.open(drawnBy('webgl', server.url));
});

afterAll(async () => {
  await browser?.close();
  await server?.stop();
});

/** Keeps what every further picture shows, and the pictures themselves. */
function watch(): Promise<void> {
  return page.evaluate(() => {
    const { stage, body } = window.ico3d!;
    const gl = stage.renderer.getContext();
    const draw = Object.getPrototypeOf(stage).draw.bind(stage) as () => void;
    const [sights, pictures]: [Sight[], Uint8Array[]] = [[], []];
    window.picture = () => {
      draw();
      const { width, height } = stage.renderer.domElement;
      const rgba = new Uint8Array(4 * width * height);
      gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, rgba);
      return rgba;
    };
    window.psnr = (a, b) => {
      const squares = a.reduce((sum, value, i) => sum + (value - b[i]!) ** 2, 0);
      return 10 * Math.log10((255 * 255 * 0.75 * a.length) / squares); // alpha is 255 everywhere
    };
    Object.assign(window, { sights, pictures });
    stage.draw = () => {
      pictures.push(window.picture!());
      sights.push({ at: performance.now(), ...body!.shown! });
    };
  });
}

/** Goes to a time and draws it, well sorted. */
async function still(time: number): Promise<void> {
  await page.evaluate(async (seconds) => {
    const { stage, body } = window.ico3d!;
    stage.start();
    await body!.show(seconds);
    await stage.still();
  }, time);
}

describe('a body alone, served by ico3d serve', () => {
  test('has a player and no conversation', async () => {
    expect(await page.locator('#player').isVisible()).toBe(true);
    expect(await page.locator('#composer').isVisible()).toBe(false);
    expect(await page.locator('#overlay').getAttribute('inert')).not.toBeNull();
    expect(await page.evaluate(() => window.ico3d!.conversation)).toBeUndefined();
    expect(await page.textContent('#name')).toBe('Swinger');
  });

  test('plays there and back through all borders without a stall', async () => {
    await playByPictures(page);
    await page.reload();
    await page.waitForFunction(() => window.ico3d !== undefined);
    await watch();
    await page.waitForFunction(
      () => {
        const windows = window.sights!.map((sight) => sight.window);
        return windows.includes(2) && windows.lastIndexOf(2) < windows.lastIndexOf(0);
      },
    );
    const sights = await page.evaluate(() => window.sights!);
    expect(sights.filter(({ waiting }) => waiting)).toEqual([]);
    const changes = sights.filter(({ window }, i) => i > 0 && window !== sights[i - 1]!.window);
    expect([sights[0]!.window, ...changes.map(({ window }) => window)].slice(0, 5)).toEqual([0, 1, 2, 1, 0]);
    const steps = sights.slice(1).map(({ time, at }, i) => ({ step: Math.abs(time - sights[i]!.time), pause: at - sights[i]!.at }));
    for (const { step } of steps) expect(step).toBeLessThan(0.07); // two ticks, where the body was held up
    const pauses = steps.map(({ pause }) => pause).sort((a, b) => a - b);
    const atChanges = changes.map((change) => steps[sights.indexOf(change) - 1]!.pause);
    console.log(`${sights.length} pictures, pauses ${ms(pauses)}, at changes of windows ${ms(atChanges)}`);

    // The first pictures of each window, as they were seen, against well sorted ones.
    for (const change of changes.slice(0, 4)) {
      await still(change.time);
      const index = sights.indexOf(change);
      const likeness = await page.evaluate((i) => window.psnr!(window.pictures![i]!, window.picture!()), index);
      console.log(`first picture of window ${change.window} at ${change.time.toFixed(3)} s: ${likeness.toFixed(1)} dB`);
      expect(likeness).toBeGreaterThan(35);
    }
  });

  test.each([1, 2])('the picture does not change where windows meet at %i s', async (border) => {
    await still(border - 1e-5);
    expect(await page.evaluate(() => window.ico3d!.body!.shown!.window)).toBe(border - 1);
    await watch();
    const { sights, likeness } = await page.evaluate(async (seconds) => {
      const { stage, body } = window.ico3d!;
      const before = window.picture!();
      stage.start();
      for (const time of [seconds + 1e-5, seconds - 1e-5]) {
        await body!.show(time);
        const { window: shown } = body!.shown!;
        while (window.sights!.at(-1)?.window !== shown) await new Promise(requestAnimationFrame);
        await new Promise((resolve) => setTimeout(resolve, 700)); // and the pictures of later sorts
      }
      return { sights: window.sights!, likeness: window.pictures!.map((picture) => window.psnr!(picture, before)) };
    }, border);
    const windows = sights.map((sight) => sight.window).filter((window, i, all) => window !== all[i - 1]);
    expect(windows.slice(-2)).toEqual([border, border - 1]);
    console.log(`${likeness.length} pictures around ${border} s: ${Math.min(...likeness).toFixed(1)} dB at least`);
    expect(Math.min(...likeness)).toBeGreaterThan(40);
  });

  test.each(TIMES.map((time, i) => [time, i] as const))('at %f s it is what Python makes of it', async (time, i) => {
    await still(time);
    const picture = await takePixels(page);
    const moment = reference.moments[i]!;
    const { shown, splats } = await page.evaluate(() => {
      const { body, splats } = window.ico3d!;
      const { centres, rgba } = splats(body!.objects[body!.shown!.slot]);
      return { shown: body!.shown!, splats: { centres: [...centres], rgba: [...rgba] } };
    });
    expect(shown).toMatchObject({ time, waiting: false });
    if (shown.window === moment.window) {
      // At a border either window may be the one.
      const count = moment.centres.length / 3;
      expect(worst(moment.centres, splats.centres.slice(0, 3 * count))).toBeLessThan(1e-5);
      expect(worst(moment.rgba, splats.rgba.slice(0, 4 * count))).toBeLessThan(1e-3);
    }
    const truth = reference.pictures!.subarray(i * pixels, (i + 1) * pixels);
    const likeness = psnr(picture, truth);
    console.log(`${time} s: ${likeness.toFixed(1)} dB`);
    expect(likeness).toBeGreaterThan(40);
  });

  test('the player is worked with the mouse and with the keyboard', async () => {
    await page.setViewportSize({ width: 360, height: 120 });
    await page.evaluate(() => window.ico3d!.stage.start());
    const time = () => page.evaluate(() => window.ico3d!.body!.motion.time);
    const playing = () => page.evaluate(() => (window.ico3d!.body!.motion as Playback).playing);
    expect(await playing()).toBe(false);
    await page.fill('#scrub', '2.4');
    await page.waitForFunction(() => window.ico3d!.body!.shown!.window === 2);
    expect(await time()).toBeCloseTo(2.4, 2);
    await page.focus('#scrub');
    await page.keyboard.press('ArrowRight');
    expect(await time()).toBeCloseTo(37 / 15, 5);
    await page.waitForFunction(() => document.querySelector('#clock')!.textContent === '0:02.5 / 0:03.0');
    await page.click('#play');
    expect(await playing()).toBe(true);
    expect(await page.getAttribute('#play', 'aria-label')).toBe('Pause');
    await page.focus('#stage');
    await page.keyboard.press(' ');
    expect(await playing()).toBe(false);
    await page.focus('#stage');
    for (let i = 0; i < 45; i++) await page.keyboard.press('ArrowLeft'); // half around, to the back
    const z = await page.evaluate(() => window.ico3d!.stage.orbit.camera.position.z);
    expect(z).toBeLessThan(-1);
    await page.setViewportSize({ width: WIDTH, height: HEIGHT });
  });

  test('a late window: the picture stays until it is there', async () => {
    let release = () => {};
    const held = new Promise<void>((resolve) => (release = resolve));
    await page.route('**/body/0001.safetensors*', async (route) => {
      await held;
      await route.continue();
    });
    await page.reload();
    await page.waitForFunction(() => window.ico3d?.body?.shown?.waiting);
    expect(await page.evaluate(() => window.ico3d!.body!.shown)).toMatchObject({ time: 1, window: 0 });
    release();
    await page.waitForFunction(() => window.ico3d!.body!.shown!.window === 1);
    await page.unroute('**/body/0001.safetensors*');
  });

  test('a damaged window is one sentence on the page', async () => {
    await page.route('**/body/0000.safetensors*', (route) => route.fulfill({ body: 'x'.repeat(100) }));
    await page.reload();
    const sentence = page.locator('#overlay-error');
    await sentence.waitFor();
    expect(await sentence.textContent()).toBe('body/0000.safetensors is shorter than manifest.json says.');
  });
});

function ms(values: number[]): string {
  return values.length > 8
    ? `median ${values[values.length >> 1]!.toFixed(0)} ms, longest ${values.at(-1)!.toFixed(0)} ms`
    : values.map((value) => `${value.toFixed(0)} ms`).join(', ');
}
