import type { Page } from 'playwright-core';
import { afterAll, beforeAll, expect, test } from 'vitest';
import { Browser } from '../support/browser/browser.ts';
import { drawSeldom, refreshed } from '../support/browser/drawing.ts';
import { psnr, takePixels } from '../support/browser/pictures.ts';
import { makePerson } from '../support/references/person.ts';
import { servePage } from '../support/servers/static.ts';

declare global {
  interface Window {
    due?: number; // pictures so far
    distance?: () => number; // m from the camera to the head
    covered?: boolean; // whether the page counts as hidden
  }
}

const SAME = 50; // dB
const HIDDEN = 700; // ms

let server: Awaited<ReturnType<typeof servePage>>;
let browser: Browser;
let page: Page;

beforeAll(async () => {
  server = await servePage(makePerson({ gaussians: '300,450' }).folder);
  browser = await Browser.launch({ width: 160, height: 200 });
  page = await browser.open(server.url);
});

afterAll(async () => {
  await browser?.close();
  server?.close();
});

/** The view that the stage shows, and which buttons are pressed. */
const view = () =>
  page.evaluate(() => {
    const { orbit } = window.ico3d!.stage;
    const pressed = [...document.querySelectorAll('.views [aria-pressed="true"]')];
    return { shown: orbit.view, pressed: pressed.map((button) => button.getAttribute('aria-label')) };
  });

test('what the GPU held comes back after the browser took it away, even while a sort ran', async () => {
  const still = async () => {
    await page.evaluate(async () => {
      const { stage, body, head } = window.ico3d!;
      head!.director = null;
      stage.start();
      await body!.show(0.5);
      head!.express(new Float32Array(head!.expression.length));
      await stage.still();
    });
    return takePixels(page);
  };
  const before = await still();
  await page.evaluate(async () => {
    const { stage } = window.ico3d!;
    const canvas = stage.renderer.domElement;
    const happens = (name: string) => new Promise((resolve) => canvas.addEventListener(name, resolve, { once: true }));
    const extension = stage.renderer.getContext().getExtension('WEBGL_lose_context')!;
    stage.start();
    stage.draw(); // begins a sort
    const lost = happens('webglcontextlost');
    extension.loseContext();
    await lost;
    const restored = happens('webglcontextrestored');
    setTimeout(() => extension.restoreContext()); // not while the event is still heard
    await restored;
  });
  const after = await still();
  expect(new Set(before).size).toBeGreaterThan(20);
  expect(psnr(after, before)).toBeGreaterThan(SAME);
});

test('nothing is drawn and no time passes while the page is hidden', async () => {
  await drawSeldom(page);
  await page.evaluate(() => window.ico3d!.stage.start());
  const state = () =>
    page.evaluate(() => {
      const { stage, director } = window.ico3d!;
      return { hidden: document.hidden, frames: stage.frames, time: director!.time, due: window.due! };
    });
  await page.evaluate(() => {
    const { stage } = window.ico3d!;
    const { draw } = stage;
    window.due = 0;
    stage.draw = () => (window.due!++, draw.call(stage));
    Object.defineProperty(document, 'visibilityState', { get: () => (window.covered ? 'hidden' : 'visible'), configurable: true });
  });
  const cover = (covered: boolean) =>
    page.evaluate((value) => {
      window.covered = value;
      document.dispatchEvent(new Event('visibilitychange'));
    }, covered);
  await cover(true);
  const before = await state();
  await page.waitForTimeout(HIDDEN);
  expect(await state()).toEqual(before);
  const step = await page.evaluate(() => {
    const { body } = window.ico3d!;
    const tick = body!.tick.bind(body);
    return new Promise<number>((resolve) => {
      body!.tick = (step) => {
        resolve(step);
        body!.tick = tick;
        return tick(step);
      };
      window.covered = false;
      document.dispatchEvent(new Event('visibilitychange'));
    });
  });
  expect(step).toBe(0);
  await page.waitForFunction((due) => window.due! > due, before.due);
});

test('keys and buttons fly to face, half and whole figure; a text takes the keys', async () => {
  await page.focus('#stage');
  expect(await view()).toEqual({ shown: 'half', pressed: ['Head and chest'] });
  await page.evaluate(() => {
    const { stage, head } = window.ico3d!;
    window.distance = () => stage.orbit.camera.position.distanceTo(head!.generator.position);
  });
  const distance = () => page.evaluate(() => window.distance!());
  const half = await distance();
  await page.keyboard.press('3');
  expect(await view()).toEqual({ shown: 'whole', pressed: ['Whole figure'] });
  await refreshed(page);
  const first = await distance();
  await page.waitForFunction((half) => window.distance!() > 1.5 * half, half);
  expect(first).toBeLessThan(1.4 * half); // it flies
  await page.getByRole('button', { name: 'Face' }).click();
  expect(await view()).toEqual({ shown: 'face', pressed: ['Face'] });
  await page.waitForFunction((half) => window.distance!() < 0.8 * half, half);
  await page.focus('#text');
  await page.keyboard.press('3');
  expect(await page.inputValue('#text')).toBe('3');
  expect((await view()).shown).toBe('face');
  await page.focus('#stage');
  await page.keyboard.press('ArrowLeft');
  expect(await view()).toEqual({ shown: null, pressed: [] });
});

test('what the GPU holds goes back when the stage is taken down', async () => {
  const left = await page.evaluate(async () => {
    const { stage } = window.ico3d!;
    stage.start();
    stage.dispose();
    const { frames } = stage;
    await new Promise((resolve) => requestAnimationFrame(() => requestAnimationFrame(resolve)));
    return { lost: stage.renderer.getContext().isContextLost(), drawn: stage.frames - frames };
  });
  expect(left).toEqual({ lost: true, drawn: 0 });
});
