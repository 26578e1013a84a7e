import type { Page } from 'playwright-core';
import { afterAll, beforeAll, expect, test } from 'vitest';
import { Browser } from '../support/browser/browser.ts';
import { drawSeldom, playByPictures, refreshed } from '../support/browser/drawing.ts';
import { drawnBy } from '../support/browser/path.ts';
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
  await playByPictures(browser.page);
  page = await browser.open(drawnBy('webgl', server.url));
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
  const small = page.viewportSize()!; // there, a face is as near as words above and controls below let it be
  await page.setViewportSize({ width: 480, height: 480 });
  await refreshed(page);
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
  await page.setViewportSize(small);
});

test('somebody stands on a floor with a shadow in a room, bright or dark, which all ways of drawing show alike', async () => {
  const colours = () =>
    page.evaluate(() => {
      const { stage, head, body } = window.ico3d!;
      const { camera } = stage.orbit;
      const gl = stage.renderer.getContext();
      for (const object of [...head!.objects, ...body!.objects]) object.visible = false;
      stage.orbit.show('whole');
      for (let i = 0; i < 10; i++) stage.orbit.update(0.1);
      stage.scene.add(stage.scenery); // the room of this person's own has none
      stage.scene.traverse((node) => void (node.visible = node === stage.scene || node === stage.scenery));
      stage.renderer.render(stage.scene, camera);
      const foot = stage.scenery.material.uniforms.foot!.value.clone();
      const at = (x: number, y: number, z: number) => {
        const place = foot.clone();
        place.add({ x, y, z }).project(camera);
        const rgba = new Uint8Array(4);
        const { width, height } = stage.renderer.domElement;
        gl.readPixels(((1 + place.x) * width) / 2, ((1 + place.y) * height) / 2, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, rgba);
        const out = new Float32Array(3);
        const eye = foot.clone().setFromMatrixPosition(camera.matrixWorld);
        stage.scenery.colour(eye, foot.clone().add({ x, y, z }).sub(eye).normalize(), out, 0);
        return { green: rgba[1]!, apart: Math.abs(255 * out[1]! - rgba[1]!) };
      };
      const seen = { shadow: at(0, 0, 0), beside: at(0.75, 0, 0), head: at(0, 1.2, 0) };
      stage.scene.traverse((node) => void (node.visible = true));
      stage.scenery.removeFromParent();
      return seen;
    });
  await page.evaluate(() => window.ico3d!.stage.setBright(false));
  const dark = await colours();
  await page.evaluate(() => window.ico3d!.stage.setBright(true));
  const bright = await colours();
  for (const seen of [dark, bright]) {
    expect(seen.shadow.green).toBeLessThan(0.75 * seen.beside.green);
    for (const { apart } of Object.values(seen)) expect(apart).toBeLessThan(4); // a pixel is not a point
  }
  expect(bright.beside.green).toBeGreaterThan(2 * dark.beside.green);
  expect(bright.head.green).toBeGreaterThan(dark.head.green + 60);
});

test('the page is light or dark as the system is, then as the visitor chooses', async () => {
  const theme = () => page.evaluate(() => document.body.dataset.theme);
  await page.emulateMedia({ colorScheme: 'light' });
  await expect.poll(theme).toBe('light');
  const ink = () => page.evaluate(() => getComputedStyle(document.querySelector('#name')!).color);
  const onLight = await ink();
  await page.emulateMedia({ colorScheme: 'dark' });
  await expect.poll(theme).toBe('dark');
  expect(await ink()).not.toBe(onLight);
  await page.getByRole('button', { name: 'Make it light' }).click();
  expect(await theme()).toBe('light');
  expect(await ink()).toBe(onLight);
});

test('where pictures take too long, the backdrop goes first, then pixels; the figures say so', async () => {
  const asked = await page.evaluate(() => {
    const { stage, backdrop } = window.ico3d!;
    const shares: number[] = [];
    const thin = backdrop!.thin!.bind(backdrop);
    backdrop!.thin = (share) => (shares.push(share), thin(share));
    const { width } = stage.renderer.domElement;
    for (const index of [1, 2, 4]) stage.holdQuality(index);
    return { shares, pixels: stage.renderer.domElement.width / width };
  });
  expect(asked.shares).toEqual([0.5, 0.2, 0.2]);
  expect(asked.pixels).toBeCloseTo(0.65, 2);
  await page.getByRole('button', { name: 'Figures' }).click();
  await expect.poll(() => page.locator('#figures').innerText()).toMatch(/quality\s+lower where pictures would come too slowly\s+2 of 6, the best is 6/);
  await expect.poll(() => page.locator('#figures').innerText()).toMatch(/evaluate\s+face and body, for each picture\s+[\d.]+ ms\s+draw\s+until a picture is there\s+[\d.]+ ms\s+sort\s+\d+ ms\s+Gaussians\s+[\d,]+/);
});

test('thinned out, the backdrop’s largest splats stay; what stands still is made once', async () => {
  const active = (index: number) =>
    page.evaluate(async (index) => {
      const { stage, head, body, backdrop } = window.ico3d!;
      for (const object of [...head!.objects, ...body!.objects]) object.visible = false;
      if (index === 0) await stage.still();
      else {
        stage.holdQuality(index);
        await stage.spark.update({ scene: stage.scene, camera: stage.orbit.camera });
        while (stage.spark.sorting || stage.spark.sortDirty) await new Promise((resolve) => setTimeout(resolve, 5));
      }
      return { count: stage.spark.activeSplats, version: backdrop!.objects[0] && (backdrop!.objects[0] as { version?: number }).version };
    }, index);
  const [all, half, few] = [await active(0), await active(1), await active(2)];
  console.log(`${all.count}, ${half.count} and ${few.count} splats behind the person`);
  expect(Math.abs(half.count / all.count - 0.5)).toBeLessThan(0.1);
  expect(Math.abs(few.count / all.count - 0.2)).toBeLessThan(0.1);
  expect((await active(2)).version).toBe(few.version);
});

test('?bench measures each part and all of them, in two sizes', async () => {
  await page.goto(drawnBy('webgl', `${server.url}?bench=0.01`));
  const table = page.locator('.bench');
  await expect.poll(() => table.textContent()).toContain('Done.');
  const rows = (await table.textContent())!.split('\n').filter((line) => / ms \|$/.test(line)).map((line) => line.split('|').map((cell) => cell.trim()));
  expect(rows.map(([, part]) => part)).toEqual(['background', 'body', 'head', 'all', 'background', 'body', 'head', 'all']);
  expect(rows.map(([, , pixels]) => pixels)).toEqual([...Array(4).fill('512 × 512'), ...Array(4).fill('160 × 200')]);
  const [behind, body, head, all] = rows.map(([, , , gaussians]) => Number(gaussians));
  expect(behind! + body! + head!).toBe(all);
  for (const [, , , , rate] of rows) expect(Number(rate)).toBeGreaterThan(0);
  await page.waitForFunction(() => window.ico3d !== undefined);
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
