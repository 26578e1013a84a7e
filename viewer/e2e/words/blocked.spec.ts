import { join } from 'node:path';
import { afterEach, expect, inject, test } from 'vitest';
import type { Browser } from '../../support/browser/browser.ts';
import { openPage } from '../../support/browser/talk.ts';

const { talkingUrl } = inject('shared');

let browser: Browser;
afterEach(() => browser?.close());

test('a blocked microphone is shown so for as long as it is', async () => {
  browser = await openPage(talkingUrl, { width: 640, height: 360, calm: true });
  const { page, context } = browser;
  await context.grantPermissions([]); // all others are denied
  await page.click('#microphone');
  const shown = () =>
    page.$eval('#microphone', (button) => [button.getAttribute('aria-label'), button.getAttribute('title'), button.querySelector('path')!.getAttribute('d')!.endsWith('M4 3.5l16 17')]);
  const blocked = ['Microphone, blocked', expect.stringMatching(/^The microphone is blocked for this page: allow it/), true];
  await expect.poll(shown).toEqual(blocked);
  await page.waitForFunction(() => document.getElementById('notices')!.childElementCount === 0);
  expect(await shown()).toEqual(blocked);
  if (process.env.PICTURES) await page.screenshot({ path: join(process.env.PICTURES, 'blocked.png') });
  await context.grantPermissions(['microphone']);
  await expect.poll(shown).toEqual(['Microphone', 'Turn the microphone on', false]);
});
