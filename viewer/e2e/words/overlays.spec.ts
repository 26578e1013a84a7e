import { join } from 'node:path';
import type { Page } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, inject, test } from 'vitest';
import { Browser } from '../../support/browser/browser.ts';
import { refreshed } from '../../support/browser/drawing.ts';
import { overHead } from '../../support/browser/head.ts';
import { drawnBy } from '../../support/browser/path.ts';
import { VIEWS } from '../../src/stage/camera/framing.ts';

const AROUND = 'header button, #name, #state, header .way-back, main > *';
const LONG = 'Words that fill a line, and then another one, and more of them. '.repeat(8);
const SIZES = [
  [844, 390],
  [667, 375],
  [390, 844],
  [1440, 900],
  [1280, 800],
] as const;
const { demoUrl } = inject('shared');

describe.skipIf(!demoUrl)('what is around the picture of the packaged demo', () => {
  let browser: Browser;
  let page: Page;

  /** She answers at length, on a page of many letters. */
  beforeAll(async () => {
    browser = await Browser.launch({ width: 844, height: 390, calm: true });
    ({ page } = browser);
    await page.addInitScript(() => {
      const xr = Object.assign(new EventTarget(), { offered: false, isSessionSupported: () => Promise.resolve(xr.offered) });
      Object.defineProperty(navigator, 'xr', { value: xr });
      localStorage.setItem('ico3d-language', 'de');
    });
    await browser.open(drawnBy('soft', demoUrl!));
    await page.waitForSelector('#captions:visible');
    await page.waitForFunction(() => document.body.dataset.state === 'idle');
    await page.evaluate((text) => {
      document.getElementById('question')!.textContent = text.slice(0, 60);
      document.querySelector('#answer span')!.textContent = text;
      document.getElementById('state')!.textContent = 'Sprechen oder tippen';
      document.getElementById('stop')!.classList.remove('gone');
    }, LONG);
  });

  afterAll(() => browser?.close());

  /** From now on the device offers VR and AR, or neither. */
  async function offerHeadsets(offered: boolean): Promise<void> {
    await page.evaluate((offered) => Object.assign(navigator.xr!, { offered }).dispatchEvent(new Event('devicechange')), offered);
    await page.waitForFunction((count) => document.querySelectorAll('.xr button').length === count, offered ? 2 : 0);
  }

  describe.each(SIZES.flatMap((size) => [false, true].map((headsets) => [...size, headsets] as const)))('of %i × %i, headsets: %s', (width, height, headsets) => {
    beforeAll(async () => {
      await page.setViewportSize({ width, height });
      await offerHeadsets(headsets);
      await page.waitForFunction((width) => document.querySelector<HTMLCanvasElement>('#stage')!.width === width, width);
      await refreshed(page);
    });

    test.each(VIEWS)('lies over neither face nor hair in the view %s', async (view) => {
      await page.evaluate((view) => window.ico3d!.stage.orbit.show(view), view);
      const { head, over } = await overHead(page, AROUND);
      if (process.env.PICTURES) await page.screenshot({ path: join(process.env.PICTURES, `overlays-${width}x${height}-${view}${headsets ? '-xr' : ''}.png`) });
      expect(head).toBeGreaterThan(300);
      expect(over).toEqual([]);
    });

    test('does not cover one another, and is all in the picture', async () => {
      const boxes = await page.$$eval('header button, #name, #captions, #stop, #composer', (parts) =>
        parts.map((part) => ({ name: part.id || (part as HTMLElement).title, ...(part.getBoundingClientRect().toJSON() as DOMRect) })).filter(({ width }) => width > 0),
      );
      expect(boxes.length).toBe(headsets ? 14 : 12);
      for (const [i, a] of boxes.entries()) {
        expect.soft(a.left >= 0 && a.top >= 0 && a.right <= width && a.bottom <= height, a.name).toBe(true);
        for (const b of boxes.slice(i + 1)) {
          expect.soft(a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom, `${a.name} and ${b.name}`).toBe(false);
        }
      }
    });
  });
});
