import { join } from 'node:path';
import type { Locator, Page } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, inject, test } from 'vitest';
import { judge } from '../../support/browser/axe.ts';
import type { Browser } from '../../support/browser/browser.ts';
import { refreshed } from '../../support/browser/drawing.ts';
import { openPage } from '../../support/browser/talk.ts';

const { demoUrl, talkingUrl } = inject('shared');
const SHEETS = ['panel', 'settings', 'drawer'] as const;
const PHONES = [
  [844, 390],
  [667, 375],
  [390, 844],
  [360, 640],
] as const;

interface Box {
  left: number;
  top: number;
  right: number;
  bottom: number;
}

let browser: Browser;
let page: Page;

beforeAll(async () => {
  browser = await openPage(demoUrl ?? talkingUrl, { width: 1280, height: 720, calm: true });
  ({ page } = browser);
  await page.waitForSelector('#drawer-button:visible');
});

afterAll(() => browser?.close());

/** The sheets that are open. */
const open = () => page.evaluate((ids) => ids.filter((id) => !document.getElementById(id)!.hidden), ['origin', ...SHEETS]);

const focused = () => page.evaluate(() => document.activeElement!.id);

/** From the brows to the chin and from ear to ear, in pixels of the page. */
function face(): Promise<Box> {
  return page.evaluate(() => {
    const { stage } = window.ico3d!;
    const { camera } = stage.orbit;
    const { eyes } = stage.meeting!;
    const { left, top, width, height } = document.getElementById('stage')!.getBoundingClientRect();
    camera.updateMatrixWorld();
    const at = (right: number, up: number) => {
      const { x, y } = eyes.clone().add(eyes.clone().set(right, up, 0).applyQuaternion(camera.quaternion)).project(camera);
      return [left + ((1 + x) * width) / 2, top + ((1 - y) * height) / 2] as const;
    };
    const [[x0, y0], [x1, y1]] = [at(-0.075, 0.04), at(0.075, -0.12)];
    return { left: x0, top: y0, right: x1, bottom: y1 };
  });
}

const box = (what: string | Locator): Promise<Box> =>
  (typeof what === 'string' ? page.locator(what) : what).evaluate((element) => {
    const { left, top, right, bottom } = element.getBoundingClientRect();
    return { left, top, right, bottom };
  });

const overlap = (a: Box, b: Box) => a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom;

describe('every sheet', () => {
  test.each(SHEETS)('%s has a name and a ✕; that, Escape from the text box and a click on the picture close it', async (sheet) => {
    await page.setViewportSize({ width: 1280, height: 720 });
    const button = `#${sheet}-button`;
    const ways = [
      () => page.click(`#${sheet} .close`),
      async () => {
        await page.focus('#text');
        await page.keyboard.press('Escape');
      },
      () => page.mouse.click(300, 300),
    ];
    for (const close of ways) {
      await page.click(button);
      expect(await open()).toEqual([sheet]);
      expect(await page.textContent(`#${sheet} h2`)).toBe({ panel: 'Figures', settings: 'Settings', drawer: 'Transcript' }[sheet]);
      await close();
      expect(await open()).toEqual([]);
      expect(await focused()).toBe(`${sheet}-button`);
      expect(await page.getAttribute(button, 'aria-expanded')).toBe('false');
    }
  });

  test('stays while the picture is turned, or somebody types', async () => {
    await page.click('#panel-button');
    await page.mouse.move(300, 300);
    await page.mouse.down();
    await page.mouse.move(340, 300);
    await page.mouse.move(300, 300 + 20);
    await page.mouse.up();
    await page.click('#text');
    expect(await open()).toEqual(['panel']);
    expect(await focused()).toBe('text');
    await page.keyboard.press('Escape');
    await page.focus('#stage');
    await page.keyboard.press('Home'); // the camera follows the shape of the picture again
  });

  test('closes when another one opens, on a desktop and on a phone', async () => {
    for (const [width, height] of [[1280, 720], [360, 640]] as const) {
      await page.setViewportSize({ width, height });
      for (const sheet of ['settings', 'drawer', 'panel', 'drawer', 'origin', 'settings']) {
        await page.evaluate((sheet) => document.querySelector<HTMLElement>(`[aria-controls=${sheet}]`)!.click(), sheet);
        expect(await open()).toEqual([sheet]);
      }
      await page.keyboard.press('t');
      expect(await open()).toEqual(['drawer']);
      await page.keyboard.press('Escape');
      expect(await open()).toEqual([]);
    }
  });
});

test('a picture that was clicked has no frame, one that the keyboard has reached has', async () => {
  await page.setViewportSize({ width: 1280, height: 720 });
  const frame = () => page.locator('#stage').evaluate((stage) => getComputedStyle(stage).outlineStyle);
  await page.mouse.click(300, 300);
  await page.keyboard.press('ArrowLeft');
  expect([await focused(), await frame()]).toEqual(['stage', 'none']);
  await page.keyboard.press('Tab');
  await page.keyboard.press('Shift+Tab');
  expect([await focused(), await frame()]).toEqual(['stage', 'solid']);
  await page.keyboard.press('Home');
});

test('a long figure takes the room beside its name', async () => {
  await page.setViewportSize({ width: 1280, height: 720 });
  await page.click('#panel-button');
  const name = page.locator('#panel dt', { hasText: 'drawn by' });
  await name.waitFor();
  const [lines, share] = await name.evaluate((term) => {
    const value = term.nextElementSibling as HTMLElement;
    value.textContent = 'the processor, as there is no graphics card: WebGL would be slower (ANGLE (Mesa, llvmpipe (LLVM 15.0.6 256 bits), OpenGL ES 3.2))';
    const { width, height } = value.getBoundingClientRect();
    const line = Number.parseFloat(getComputedStyle(value).lineHeight);
    return [Math.round(height / line), width / document.getElementById('figures')!.clientWidth];
  });
  await page.keyboard.press('Escape');
  expect(lines).toBeLessThanOrEqual(5);
  expect(share).toBeGreaterThan(0.65);
});

test('a service without another to choose is told in words', async () => {
  await page.click('#settings-button');
  const names = await page.locator('#services input').evaluateAll((inputs) => inputs.map((input) => (input as HTMLInputElement).name));
  const kinds = await page.locator('#services > :not(details)').allTextContents();
  await page.keyboard.press('Escape');
  expect(names.filter((name) => names.indexOf(name) === names.lastIndexOf(name))).toEqual([]);
  expect(kinds.map((text) => /^(Listens|Thinks|Speaks)./.test(text))).toEqual([true, true, true]);
});

test.each([
  [352, 476],
  [352, 516],
  [320, 440],
])('nothing lies over a sheet in a frame of %i × %i on another page', async (width, height) => {
  await page.setViewportSize({ width, height });
  for (const sheet of ['panel', 'settings']) {
    await page.click(`#${sheet}-button`);
    if (process.env.PICTURES) await page.screenshot({ path: join(process.env.PICTURES, `${sheet}-${width}x${height}.png`) });
    const over = await page.locator(`#${sheet}`).evaluate((part) => {
      const { left, top, width, height } = part.getBoundingClientRect();
      const shares = Array.from({ length: 19 }, (_, i) => (i + 1) / 20);
      const found = shares.flatMap((x) => shares.map((y) => document.elementFromPoint(left + x * width, top + y * height)!));
      return [...new Set(found.filter((element) => !part.contains(element)).map(({ outerHTML }) => outerHTML.slice(0, 80)))];
    });
    await page.click(`#${sheet} .close`);
    expect(over).toEqual([]);
  }
});

describe.each(PHONES)('on a phone of %i × %i', (width, height) => {
  test.each(SHEETS)('%s leaves the face and its own ✕ in sight', async (sheet) => {
    await page.setViewportSize({ width, height });
    await page.click(`#${sheet}-button`);
    await page.evaluate(() => {
      const record = document.getElementById('record')!;
      const row = record.firstElementChild!;
      while (record.children.length < 30) record.append(row.cloneNode(true)); // a long talk
    });
    await refreshed(page);
    if (process.env.PICTURES) {
      await page.evaluate(() => window.draw!());
      await page.screenshot({ path: join(process.env.PICTURES, `${sheet}-${width}.png`) });
    }
    const [part, seen] = [await box(`#${sheet}`), await face()];
    expect.soft(overlap(part, seen)).toBe(false);
    const close = await box(`#${sheet} .close`);
    for (const button of await page.locator('.figures > button:visible').all()) expect.soft(overlap(close, await box(button))).toBe(false);
    expect.soft(part.bottom).toBeLessThanOrEqual(height);
    if (width > height) {
      expect.soft([part.top, part.right, part.bottom]).toEqual([0, width, height]);
      expect.soft((await box('#stage')).right).toBeLessThanOrEqual(part.left);
    }
    await page.click(`#${sheet} .close`);
    expect(await open()).toEqual([]);
  });

  test('the buttons keep their order', async () => {
    const order = () =>
      page.locator('.figures > button:visible').evaluateAll((buttons) =>
        buttons
          .map((button) => ({ id: button.id, ...button.getBoundingClientRect().toJSON() }) as { id: string; x: number; y: number })
          .sort((a, b) => a.y - b.y || a.x - b.x)
          .map(({ id }) => id)
          .filter(Boolean),
      );
    const wanted = ['panel-button', 'settings-button', 'drawer-button'];
    expect(await order()).toEqual(wanted);
    await page.click('#drawer-button');
    expect(await order()).toEqual(wanted);
    await page.click('#drawer-close');
  });
});

test('axe finds nothing serious in any sheet', async () => {
  for (const sheet of SHEETS) {
    await page.setViewportSize({ width: 1280, height: 720 });
    await page.click(`#${sheet}-button`);
    if (sheet === 'settings') await page.locator('#services summary').click();
    await judge(page, sheet);
    await page.keyboard.press('Escape');
  }
});
