import { afterEach, describe, expect, inject, test } from 'vitest';
import { Browser } from '../../support/browser/browser.ts';
import { drawnBy } from '../../support/browser/path.ts';
import { keepSound } from '../../support/browser/talk.ts';

const { talkingUrl } = inject('shared');

let browser: Browser;
afterEach(() => browser?.close());

describe.each(['', 'check', 'studio'])('the page /%s before its script is there', (path) => {
  test.each([
    ['light', null, 'light'],
    ['dark', null, 'dark'],
    ['light', 'dark', 'dark'],
    ['dark', 'light', 'light'],
  ] as const)('is in the colours of a %s system and of what was chosen (%s)', async (colorScheme, chosen, expected) => {
    browser = await Browser.launch();
    const { page } = browser;
    await page.emulateMedia({ colorScheme });
    if (chosen) await page.addInitScript((theme) => localStorage.setItem('ico3d-theme', theme), chosen);
    await page.route(/(?<!first-theme-[^/]*)\.js$/, () => {}); // which never comes
    await page.goto(talkingUrl + path, { waitUntil: 'commit' });
    await page.waitForFunction(() => document.readyState !== 'loading'); // it was read, and its styles are there
    const theme = await page.evaluate(() => {
      const themed = document.querySelector('[data-theme]') ?? document.body;
      const { color, colorScheme } = getComputedStyle(themed);
      return { light: color === 'rgb(31, 29, 26)', colorScheme };
    });
    expect(theme).toEqual({ light: expected === 'light', colorScheme: expected });
  });
});

test.each(['webgl', 'soft'] as const)('nothing is seen of the stage before its first picture (%s)', async (path) => {
  browser = await Browser.launch({ calm: true });
  const { page } = browser;
  await keepSound(page);
  await page.addInitScript(() => {
    const request = window.requestAnimationFrame.bind(window);
    const held = new Promise<void>((resolve) => addEventListener('draw', () => resolve()));
    window.requestAnimationFrame = (draw) => {
      void held.then(() => request(draw));
      return 0;
    };
  });
  await page.goto(drawnBy(path, talkingUrl));
  await page.waitForSelector('#choices:visible');
  const seen = () =>
    page.evaluate(() => ({
      frames: window.ico3d!.stage.frames > 0,
      stage: getComputedStyle(document.getElementById('stage')!).visibility,
      cover: getComputedStyle(document.getElementById('overlay')!, '::before').opacity,
    }));
  expect(await seen()).toEqual({ frames: false, stage: 'hidden', cover: '1' });
  await page.evaluate(() => dispatchEvent(new Event('draw')));
  await expect.poll(seen).toEqual({ frames: true, stage: 'visible', cover: '0' });
});

test('who talks at once sees the cover until the first picture, too', async () => {
  browser = await Browser.launch({ calm: true });
  const { page } = browser;
  await page.addInitScript(() => (window.requestAnimationFrame = () => 0));
  await page.goto(drawnBy('webgl', talkingUrl));
  await page.waitForSelector('#overlay.gone', { state: 'attached' });
  expect(await page.$eval('#overlay', (overlay) => getComputedStyle(overlay).opacity)).toBe('1');
});
