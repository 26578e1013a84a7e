import { afterAll, beforeAll, expect, inject, test } from 'vitest';
import { judge } from '../../support/browser/axe.ts';
import { Browser } from '../../support/browser/browser.ts';
import { pauseDrawing } from '../../support/browser/drawing.ts';
import { drawnBy } from '../../support/browser/path.ts';

const { talkingUrl } = inject('shared');
const SAID = 'tell me about yourself';

let browser: Browser;
const told: unknown[] = []; // what the page tells of earlier visits

beforeAll(async () => {
  browser = await Browser.launch({ width: 1280, height: 720, calm: true });
  await browser.page.routeWebSocket(/\/ws/, (line) => {
    const server = line.connectToServer();
    line.onMessage((frame) => {
      const notes = typeof frame === 'string' && frame.startsWith('{"type":"notes"');
      if (notes) told.push(JSON.parse(frame).texts);
      else server.send(frame); // its small model would not take them
    });
    server.onMessage((frame) => line.send(typeof frame === 'string' ? frame.replace('"remembers":false', '"remembers":true') : frame));
  });
});
afterAll(() => browser?.close());

/** A visit, until the greeting. */
async function visit(): Promise<void> {
  const { page } = browser;
  await browser.open(drawnBy('soft', talkingUrl));
  await pauseDrawing(page);
  await page.waitForFunction(() => document.querySelector('#answer')!.textContent === 'Hello.');
}

const kept = () => browser.page.evaluate(() => Object.entries(localStorage).filter(([key]) => key.startsWith('ico3d-visits-')));
const shown = () => browser.page.locator('#memory-notes li span').allTextContents();

async function ask(question: string): Promise<void> {
  await browser.page.fill('#text', question);
  await browser.page.press('#text', 'Enter');
}

test('who agrees is remembered at the next visit, sees what is kept, and deletes it', async () => {
  const { page } = browser;
  await visit();
  await judge(page, 'asked whether it may remember');
  await ask('this is not to be kept');
  expect(await kept()).toEqual([]);
  await page.click('#memory-yes');
  expect(await page.isHidden('#memory-ask')).toBe(true);
  await ask(SAID);
  await ask('and how are you?');
  await page.click('#settings-button');
  expect([await page.isChecked('#memory-kept'), await shown()]).toEqual([true, [SAID, 'and how are you?']]);
  await judge(page, 'settings with what is kept');
  await page.click('#memory-notes li:last-child button');
  expect(await shown()).toEqual([SAID]);
  expect(told).toEqual([]);

  await visit();
  expect(told).toEqual([[SAID]]);
  expect(await page.locator('#record .divider').first().textContent()).toBe('Earlier'); // she was told of it
  expect(await page.isHidden('#memory-ask')).toBe(true);
  await page.click('#settings-button');
  await page.click('#memory-forget');
  expect([await shown(), await page.isHidden('#memory-forget')]).toEqual([[], true]);
  await page.uncheck('#memory-kept');
  await ask('nor is this');
  expect(JSON.stringify(await kept())).not.toMatch(/this|yourself/);
});
