import { afterAll, beforeAll, expect, inject, test } from 'vitest';
import type { Browser } from '../../support/browser/browser.ts';
import { finished, openPage, SHORTER, until } from '../../support/browser/talk.ts';
import { PATIENCE } from '../../support/patience.ts';

const LEAST = 8000; // ms for which captions stay

const { talkingUrl } = inject('shared');

let browser: Browser;
beforeAll(async () => {
  browser = await openPage(talkingUrl, { width: 640, height: 720, calm: true });
  await until(browser, finished(0)); // the greeting
});
afterAll(() => browser?.close());

test('the line about small services stays until a first question was answered, and the settings tell it for ever', async () => {
  const { page } = browser;
  const told = 'Basic offline services listen, answer, and speak';
  expect(await page.textContent('#stand-ins')).toMatch(told);
  expect(await page.isVisible('#stand-ins')).toBe(true); // she has said "Hello", nobody asked
  await page.fill('#text', SHORTER);
  await page.press('#text', 'Enter');
  await until(browser, finished(1));
  await page.waitForSelector('#stand-ins', { state: 'hidden' });
  await page.click('#settings-button');
  expect(await page.textContent('#stand-ins-kept:visible')).toBe(told);
  await page.keyboard.press('Escape');
});

test('captions leave once they could be read, but not from under the pointer, and come back with the next question', async () => {
  const { page } = browser;
  const { x, y, width, height } = (await page.locator('#captions').boundingBox())!;
  await page.mouse.move(x + width / 2, y + height / 2);
  const said = await page.textContent('#answer');
  expect(said).toMatch(/Gaussians/);
  await page.waitForTimeout(LEAST + 3000);
  expect(await page.isVisible('#captions')).toBe(true);
  await page.mouse.move(5, 5);
  await page.waitForSelector('#captions', { state: 'hidden', timeout: PATIENCE });
  expect(await page.locator('#record > div').last().textContent()).toContain(said);
  expect(await page.textContent('#announcer')).toContain(said); // nothing new is read out
  await page.fill('#text', SHORTER);
  await page.press('#text', 'Enter');
  await page.waitForSelector('#captions:visible');
  expect(await page.$eval('#captions', (captions) => captions.className)).toBe('');
  await until(browser, finished(2));
  const begun = Date.now();
  await page.waitForSelector('#captions', { state: 'hidden', timeout: PATIENCE });
  expect(Date.now() - begun).toBeGreaterThan(LEAST - 1000); // the page told of the end a moment before
});
