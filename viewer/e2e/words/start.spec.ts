import { join } from 'node:path';
import type { Page } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, inject, test } from 'vitest';
import { Browser } from '../../support/browser/browser.ts';
import { refreshed } from '../../support/browser/drawing.ts';
import { drawnBy } from '../../support/browser/path.ts';
import { keepSound } from '../../support/browser/talk.ts';

const { demoUrl, talkingUrl } = inject('shared');
const LOW = [
  [844, 390],
  [844, 330],
  [667, 320],
  [568, 320],
  [390, 844],
] as const;

let browser: Browser;
let page: Page;

beforeAll(async () => {
  browser = await Browser.launch({ width: 844, height: 390, calm: true });
  ({ page } = browser);
  await keepSound(page);
  await browser.open(drawnBy('soft', demoUrl ?? talkingUrl));
  await page.waitForSelector('#choices:visible');
  await page.waitForSelector('#thumbnail:visible');
});

afterAll(() => browser?.close());

describe.each(['en', 'de', 'es', 'fr', 'ja', 'zh'])('the start screen (%s)', (language) => {
  beforeAll(async () => {
    await page.selectOption('#language', language, { force: true });
    expect(await page.evaluate(() => document.documentElement.lang)).toBe(language);
  });

  test.each(LOW)('fits into %i × %i: name, words and both buttons', async (width, height) => {
    await page.setViewportSize({ width, height });
    if (process.env.PICTURES) await page.screenshot({ path: join(process.env.PICTURES, `start-${language}-${width}x${height}.png`) });
    const parts = await page.$$eval('.portrait, .card h2, .card p, .card button', (parts) =>
      parts.map((part) => ({ text: part.textContent, ...(part.getBoundingClientRect().toJSON() as DOMRect) })).filter(({ height }) => height > 0),
    );
    expect(parts.length).toBeGreaterThanOrEqual(5);
    for (const { text, top, bottom } of parts) expect.soft(top >= 0 && bottom <= height, `${text}: ${top} to ${bottom}`).toBe(true);
  });

  test.runIf(demoUrl).each([[1280, 800], [390, 844], [844, 390], [320, 480]])('shows herself where her portrait was, and leaves her face free (%i × %i)', async (width, height) => {
    await page.setViewportSize({ width, height });
    await page.waitForFunction((width) => document.querySelector<HTMLCanvasElement>('#stage')!.width === width, width);
    await refreshed(page);
    const { portrait, card, opacity, eyes, cheek, chin } = await page.evaluate(() => {
      const { stage } = window.ico3d!;
      const { eyes, ground } = stage.meeting!;
      const side = ground.up.clone().cross(ground.toward);
      const seen = (aside: number, down: number) => {
        const { x, y } = eyes.clone().addScaledVector(side, aside).addScaledVector(ground.up, -down).project(stage.orbit.camera);
        return { x: ((1 + x) / 2) * innerWidth, y: ((1 - y) / 2) * innerHeight };
      };
      const [portrait, card] = ['.portrait', '.card'].map((part) => document.querySelector(part)!.getBoundingClientRect().toJSON() as DOMRect);
      const { opacity } = getComputedStyle(document.querySelector('.portrait')!);
      return { portrait: portrait!, card: card!, opacity, eyes: seen(0, 0), cheek: seen(0.07, 0), chin: seen(0, 0.11) };
    });
    expect(opacity).toBe('0');
    expect(Math.abs(eyes.x - portrait.left - portrait.width / 2) / portrait.width).toBeLessThan(0.1);
    expect(Math.abs((eyes.y - portrait.top) / portrait.height - 0.36)).toBeLessThan(0.12);
    expect(card.top > chin.y || card.left > cheek.x).toBe(true);
  });

  test('scrolls to all of it where it cannot fit', async () => {
    await page.setViewportSize({ width: 844, height: 160 });
    const seen = async (what: string) => {
      await page.locator(what).scrollIntoViewIfNeeded();
      const { y, height } = (await page.locator(what).boundingBox())!;
      return y >= 0 && y + height <= 160;
    };
    expect([await seen('#start-typing'), await seen('.portrait'), await seen('#start')]).toEqual([true, true, true]);
  });
});
