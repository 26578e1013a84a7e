import { join } from 'node:path';
import { afterAll, beforeAll, expect, inject, test } from 'vitest';
import type { Browser } from '../support/browser/browser.ts';
import { scratchFolder } from '../support/scratch.ts';
import { finished, openPage, until } from '../support/browser/talk.ts';

const folder = scratchFolder();
let browser: Browser;

beforeAll(async () => {
  browser = await openPage(inject('shared').talkingUrl);
});

afterAll(() => browser?.close());

test('the sheet shows who serves, and choosing starts anew', async () => {
  const { page } = browser;
  await until(browser, finished(0)); // the greeting
  expect(await page.evaluate(() => window.ico3d!.stage.meeting!.stands)).toBe(false); // a head alone has no floor in sight
  await page.setViewportSize({ width: 420, height: 560 });
  const views = await page.locator('.views').boundingBox();
  await page.click('#panel-button');
  await page.click('#settings-button');
  expect(await page.locator('header section:visible').evaluateAll((open) => open.map(({ id }) => id))).toEqual(['settings']);
  expect(await page.locator('.views').boundingBox()).toEqual(views); // a sheet moves no button
  const sheet = (await page.locator('#settings').boundingBox())!;
  const beside = sheet.x + sheet.width < views!.x || sheet.x > views!.x + views!.width;
  expect(beside || sheet.y > views!.y + views!.height).toBe(true);
  expect(sheet.y).toBeGreaterThan(560 / 2); // in the lower half, and all of it in sight
  expect(sheet.y + sheet.height).toBeLessThanOrEqual(560);
  await page.evaluate(() => window.draw!());
  const picture = join(folder, 'services.png');
  await page.screenshot({ path: picture });
  console.log(`see ${picture}`);
  for (const kind of ['recognition', 'language', 'voice']) {
    const inputs = page.locator(`#services input[name=${kind}]`);
    expect(await page.locator(`#services input[name=${kind}]:checked`).count()).toBe((await inputs.count()) > 0 ? 1 : 0);
  }
  expect(await page.locator('#services > :not(details)').count()).toBe(3);
  expect(await page.locator('#services > fieldset input:enabled').count()).toBe(await page.locator('#services input').count());
  const others = page.locator('#services > details');
  expect(await others.locator('summary').textContent()).toBe('Other services, not installed here');
  expect(await others.locator('li').first().isVisible()).toBe(false); // folded until somebody asks
  await others.locator('summary').click();
  expect(await others.locator('li small').first().isVisible()).toBe(true); // what it needs
  await page.evaluate(() => {
    document.querySelector('#services')!.firstElementChild!.remove(); // it comes back with a new welcome
    const offer = { kind: 'language', key: 'persona-notes', name: '', hindrance: '' } as const;
    window.ico3d!.conversation!.choose(offer);
  });
  await page.waitForFunction(() => document.querySelectorAll('#services > :not(details)').length === 3);
});
