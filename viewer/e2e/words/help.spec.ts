import { afterAll, beforeAll, expect, inject, test } from 'vitest';
import { judge } from '../../support/browser/axe.ts';
import type { Browser } from '../../support/browser/browser.ts';
import { openPage } from '../../support/browser/talk.ts';

let browser: Browser;

beforeAll(async () => {
  browser = await openPage(inject('shared').talkingUrl, { width: 1280, height: 720, calm: true });
  await browser.page.waitForSelector('#drawer-button:visible');
});

afterAll(() => browser?.close());

const isOpen = () => browser.page.isVisible('#help');
const focused = () => browser.page.evaluate(() => document.activeElement!.id);

test('a question mark opens the help, also where nothing is typed yet, and Escape leads back', async () => {
  const { page } = browser;
  for (const from of ['text', 'stage']) {
    await page.focus(`#${from}`);
    await page.keyboard.press('?');
    expect([await isOpen(), await focused()]).toEqual([true, 'help']);
    expect(await page.inputValue('#text')).toBe('');
    await page.keyboard.press('Escape');
    expect([await isOpen(), await focused()]).toEqual([false, from]);
  }
  await page.fill('#text', 'who');
  await page.focus('#text');
  await page.keyboard.press('End');
  await page.keyboard.press('?');
  expect([await isOpen(), await page.inputValue('#text')]).toEqual([false, 'who?']);
  await page.fill('#text', '');
});

test('the settings lead to it, and it to the check of the device', async () => {
  const { page } = browser;
  await page.click('#settings-button');
  await page.click('#help-button');
  expect([await isOpen(), await page.isVisible('#settings')]).toEqual([true, false]);
  expect(await page.locator('#help a').evaluate((link) => (link as HTMLAnchorElement).pathname)).toMatch(/\/check$/);
  await judge(page, 'help');
  await page.click('#help .close');
  expect([await isOpen(), await focused()]).toEqual([false, 'settings-button']);
});

test('it tells keys where there is a keyboard, and gestures where there are fingers', async () => {
  const { page } = browser;
  const seen = () => page.locator('#help :is(dt, kbd):visible').allTextContents();
  await page.focus('#stage');
  await page.keyboard.press('?');
  const words = await seen();
  expect(words).toEqual(expect.arrayContaining(['Drag', 'Double click', 'Space', 'Esc', '/', 'M', 'T', '1', '2', '←', '+', 'Home', '?']));
  expect(words).not.toContain('Double tap');
  const devices = await page.context().newCDPSession(page);
  await devices.send('Emulation.setTouchEmulationEnabled', { enabled: true, maxTouchPoints: 2 });
  await page.setViewportSize({ width: 390, height: 844 });
  expect(await page.evaluate(() => matchMedia('(pointer: coarse)').matches)).toBe(true);
  expect(await seen()).toEqual(['One finger', 'Two fingers', 'Double tap']);
  await devices.send('Emulation.setTouchEmulationEnabled', { enabled: false });
});

test.each([
  [844, 390],
  [360, 640],
  [352, 476],
])('all of it is within a window of %i × %i, and nothing lies over its ✕', async (width, height) => {
  const { page } = browser;
  await page.setViewportSize({ width, height });
  if (!(await isOpen())) {
    await page.focus('#stage');
    await page.keyboard.press('?');
  }
  const { x, y, ...sheet } = (await page.locator('#help').boundingBox())!;
  expect([x >= 0, y >= 0, x + sheet.width <= width, y + sheet.height <= height]).toEqual([true, true, true, true]);
  await page.click('#help .close');
  expect(await isOpen()).toBe(false);
});
