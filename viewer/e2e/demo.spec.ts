import { afterAll, beforeAll, describe, expect, inject, test } from 'vitest';
import type { Browser } from '../support/browser/browser.ts';
import { readMouth, watchMouth } from '../support/browser/mouth.ts';
import { finished, openPage, until } from '../support/browser/talk.ts';

const { demoUrl } = inject('shared');

describe.skipIf(!demoUrl)('the packaged demo (needs src/ico3d/chat/data/demo.ico3d)', () => {
  let browser: Browser;

  beforeAll(async () => {
    browser = await openPage(demoUrl!, { calm: true }, 'webgl');
  });

  afterAll(() => browser?.close());

  test('answers a typed question aloud, and its mouth moves', async () => {
    const { page } = browser;
    await until(browser, ({ received }) => received.some(({ type }) => type === 'speech'));
    await page.keyboard.press('Escape'); // the greeting is known
    await page.waitForFunction(() => window.ico3d!.conversation!.player.heard() === null);
    await page.waitForTimeout(1000);
    await watchMouth(page, 1200); // a large head: each picture takes a quarter of a second
    await page.fill('#text', 'Who are you?');
    await page.keyboard.press('Enter');
    const { received, loudness } = await until(browser, finished(1));
    expect(received.some(({ type }) => type === 'answer')).toBe(true);
    expect(Math.max(...loudness.map(({ level }) => level))).toBeGreaterThan(0.01);
    const { pictures } = await readMouth(page);
    expect(Math.max(...pictures.map(({ change }) => change))).toBeGreaterThan(10);
  });
});
