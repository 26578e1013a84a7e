import { readdirSync, statSync } from 'node:fs';
import { join } from 'node:path';
import type { Page } from 'playwright-core';
import { describe, expect, inject, test } from 'vitest';
import { Browser } from '../../support/browser/browser.ts';
import { plugIn } from '../../support/browser/headset.ts';
import { CARD, drawnBy, pretendCard, withoutWebGL } from '../../support/browser/path.ts';
import { recordWire } from '../../support/browser/recorder.ts';
import { finished, SENTENCE, until } from '../../support/browser/talk.ts';
import { REPOSITORY } from '../../support/python.ts';

const ASSETS = join(REPOSITORY, 'src/ico3d/chat/static/assets');
const MOST_BYTES = 60e3; // compressed, of what draws without WebGL
const { talkingUrl } = inject('shared');

/** What a page fetched of what draws, by the beginnings of the names. */
function fetched(page: Page): Promise<string[]> {
  return page.evaluate(() => {
    const names = performance.getEntriesByType('resource').map(({ name }) => /assets\/([a-z-]+)-[\w-]{8}\.js/.exec(name)?.[1] ?? '');
    return ['painter', 'webgl', 'spark', 'three-webgl', 'immersion'].filter((name) => names.includes(name));
  });
}

/** Which path draws, and the words that the figures have for it. */
async function drawn(page: Page): Promise<[path: string, words: string]> {
  const words = await page.evaluate(() => {
    const terms = [...document.querySelectorAll('#figures dt')];
    return terms.find(({ textContent }) => textContent === 'drawn by')?.nextElementSibling?.textContent ?? '';
  });
  return [await page.evaluate(() => window.ico3d!.stage.painter.path), words];
}

/** How many colours a canvas shows that the processor draws on. */
function shades(page: Page, selector: string): Promise<number> {
  return page.locator(selector).evaluate((canvas: HTMLCanvasElement) => {
    const { data } = canvas.getContext('2d')!.getImageData(0, 0, canvas.width, canvas.height);
    return new Set(new Uint32Array(data.buffer)).size;
  });
}

describe('a page that chooses by itself what draws', () => {
  const open = async (url: string, prepare: (browser: Browser) => Promise<unknown> = async () => {}) => {
    const browser = await Browser.launch({ width: 160, height: 200, calm: true });
    await prepare(browser);
    const page = await browser.open(url);
    await page.waitForFunction(() => document.querySelector('#figures dd') && window.ico3d!.stage.frames > 0);
    return { browser, page };
  };

  test('takes the processor where WebGL is software, fetches nothing of WebGL, and has words for a headset', async () => {
    const { browser, page } = await open(talkingUrl, ({ page }) => plugIn(page));
    expect(await drawn(page)).toEqual(['soft', expect.stringMatching(/^the processor, as there is no graphics card.*SwiftShader/)]);
    const button = page.locator('.xr button').first();
    expect(await button.getAttribute('aria-disabled')).toBe('true');
    expect(await page.isVisible('#xr-reason')).toBe(false);
    await button.focus();
    expect(await page.isVisible('#xr-reason')).toBe(true); // as long as the focus is there
    expect(await page.textContent('#xr-reason')).toMatch(/^VR and AR need a graphics card/);
    expect(await fetched(page)).toEqual(['painter']); // and nothing for headsets
    await browser.close();
  });

  test('takes the graphics card where there is one, and fetches nothing of the other way', async () => {
    const { browser, page } = await open(talkingUrl, ({ context }) => pretendCard(context));
    expect(await drawn(page)).toEqual(['webgl', `the graphics card (${CARD})`]);
    expect(await fetched(page)).toEqual(['webgl', 'spark', 'three-webgl']);
    await browser.close();
  });

  test('goes on by the processor where the browser takes WebGL away for good', async () => {
    const { browser, page } = await open(talkingUrl, ({ context }) => pretendCard(context));
    await page.evaluate(async () => {
      const { stage } = window.ico3d!;
      stage.start();
      const canvas = stage.renderer.domElement;
      const lost = new Promise((resolve) => canvas.addEventListener('webglcontextlost', resolve, { once: true }));
      stage.renderer.getContext().getExtension('WEBGL_lose_context')!.loseContext();
      await lost;
      stage.onGone(); // as after ten seconds
    });
    await page.waitForFunction(() => window.ico3d!.stage.painter.path === 'soft' && document.querySelectorAll('.picture').length === 1);
    const before = await page.evaluate(() => window.ico3d!.stage.frames);
    await page.waitForFunction((frames) => window.ico3d!.stage.frames > frames + 2, before);
    expect(await shades(page, '.picture')).toBeGreaterThan(100); // somebody is seen
    await expect.poll(() => drawn(page)).toEqual(['soft', 'the processor, as the browser took WebGL away']);
    expect(await page.locator('#overlay').getAttribute('class')).toBe('gone');
    expect(await page.locator('#composer').evaluate((element) => getComputedStyle(element).backdropFilter)).toBe('none');
    await page.selectOption('#draw', 'webgl', { force: true });
    await page.waitForFunction(() => window.ico3d!.stage.painter.path === 'webgl'); // which there is again
    expect(await page.locator('#composer').evaluate((element) => getComputedStyle(element).backdropFilter)).toMatch(/^blur/);
    await browser.close();
  });

  test('fetches few bytes for the processor to draw', () => {
    const [painter] = readdirSync(ASSETS).filter((name) => /^painter-.*\.js\.br$/.test(name));
    const { size } = statSync(join(ASSETS, painter!));
    console.log(`${size} bytes by brotli`);
    expect(size).toBeGreaterThan(2000); // the kernel is in it
    expect(size).toBeLessThan(MOST_BYTES);
  });

  test('?bench measures without WebGL, and at the end all workers are gone', async () => {
    const { browser, page } = await open(`${drawnBy('soft', talkingUrl)}&bench=0.01`);
    const table = page.locator('.bench');
    await table.getByText('Done.').waitFor();
    const lines = (await table.textContent())!.split('\n');
    expect(lines[0]).toMatch(/^the processor alone, \d threads, \d+ cores/);
    const rows = lines.filter((line) => line.startsWith('| head ')).map((line) => line.split('|').map((cell) => cell.trim()));
    expect(rows.map(([, , pixels]) => pixels)).toEqual(['512 × 512', '160 × 200']);
    for (const [, , , gaussians, rate] of rows) expect([Number(gaussians), Number(rate)].every((value) => value > 0)).toBe(true);
    expect(page.workers().length).toBeGreaterThan(0);
    await page.evaluate(() => window.ico3d!.visit.dispose());
    await expect.poll(() => page.workers().length).toBe(0);
    await browser.close();
  });
});

describe('a talk', () => {
  test('is the same where there is no WebGL 2 at all', async () => {
    const browser = await Browser.launch({ width: 160, height: 200, calm: true });
    await recordWire(browser.context);
    await withoutWebGL(browser.context);
    const page = await browser.open(drawnBy('webgl', talkingUrl)); // which cannot be
    await until(browser, finished(0));
    await page.fill('#text', 'Who are you?');
    await page.keyboard.press('Enter');
    await until(browser, finished(1));
    expect(await drawn(page)).toEqual(['soft', 'the processor, as this browser has no WebGL 2']);
    expect(await shades(page, '#stage')).toBeGreaterThan(100); // somebody is seen
    await browser.close();
  });

  test('goes on while something else draws, which is remembered', async () => {
    const browser = await Browser.launch({ width: 480, height: 360, calm: true });
    await recordWire(browser.context);
    const page = await browser.open(talkingUrl);
    await until(browser, ({ received }) => received.some(({ type }) => type === 'speech'));
    await page.keyboard.press('Escape'); // the greeting is known
    await page.click('#settings-button');
    const speaks = (utterance: number) => window.ico3d!.conversation!.player.heard()?.utterance === utterance;
    for (const [i, path] of (['webgl', 'soft'] as const).entries()) {
      await page.fill('#text', SENTENCE); // to which there is a long answer
      await page.press('#text', 'Enter');
      await page.waitForFunction(speaks, i + 1);
      await page.selectOption('#draw', path);
      await page.waitForFunction((path) => window.ico3d!.stage.painter.path === path && document.querySelectorAll('.picture').length === 1, path);
      const before = await page.evaluate(() => window.ico3d!.stage.frames);
      await page.waitForFunction((frames) => window.ico3d!.stage.frames > frames + 2, before);
      expect(await page.evaluate(speaks, i + 1), 'she still speaks').toBe(true);
      expect(await page.inputValue('#draw')).toBe(path);
    }
    expect(await page.evaluate(() => window.record!.sockets.length)).toBe(1);
    const underrun = await page.evaluate(() => window.ico3d!.conversation!.player.underrun);
    console.log(`${underrun.toFixed(2)} s of silence by late sound`);
    await page.reload();
    await page.waitForFunction(() => window.ico3d?.stage.painter.path === 'soft');
    await expect.poll(() => drawn(page)).toEqual(['soft', 'the processor, as was chosen']);
    await browser.close();
  });
});
