import { join } from 'node:path';
import { afterAll, beforeAll, expect, test } from 'vitest';
import type { Browser } from '../support/browser/browser.ts';
import { runPython } from '../support/python.ts';
import { scratchFolder } from '../support/scratch.ts';
import { ChatServer } from '../support/servers/server.ts';
import { finished, openPage, until } from '../support/browser/talk.ts';

const folder = scratchFolder();
let server: ChatServer;
let browser: Browser;

beforeAll(async () => {
  const bundle = join(folder, 'talking.ico3d');
  runPython('references/talking_bundle.py', bundle);
  server = await ChatServer.start(bundle);
  browser = await openPage(server.url);
}, 120_000);

afterAll(async () => {
  await browser?.close();
  await server?.stop();
});

test('the sheet shows who serves, and choosing starts anew', async () => {
  const { page } = browser;
  await until(browser, finished(0), 60_000); // the greeting
  await page.click('#services-button');
  await page.setViewportSize({ width: 420, height: 560 });
  const picture = join(folder, 'services.png');
  await page.screenshot({ path: picture });
  console.log(`see ${picture}`);
  for (const kind of ['recognition', 'language', 'voice']) {
    expect(await page.locator(`#services input[name=${kind}]:checked`).count()).toBe(1);
  }
  await page.evaluate(() => {
    document.querySelector('#services fieldset')!.remove(); // it comes back with a new welcome
    const offer = { kind: 'language', key: 'persona-notes', name: '', hindrance: '' } as const;
    window.ico3d!.conversation!.choose(offer);
  });
  await page.waitForFunction(() => document.querySelectorAll('#services fieldset').length === 3);
});
