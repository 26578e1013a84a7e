import { afterEach, expect, inject, test } from 'vitest';
import { judge } from '../../support/browser/axe.ts';
import { Browser } from '../../support/browser/browser.ts';
import { plugIn } from '../../support/browser/headset.ts';
import { drawnBy } from '../../support/browser/path.ts';
import { keepSound } from '../../support/browser/talk.ts';

const { demoUrl, talkingUrl } = inject('shared');

let browser: Browser;
afterEach(() => browser?.close());

/** Opens the page of somebody who waits for the visitor. */
async function meet(url: string, path: 'soft' | 'webgl' = 'soft') {
  const { page } = browser;
  await keepSound(page);
  await browser.open(drawnBy(path, url));
  await page.waitForSelector('[data-there] #choices:visible');
  return page;
}

test('before the talk begins, what needs none may be used, and the focus stays at the button that begins it', async () => {
  browser = await Browser.launch({ width: 1280, height: 720, calm: true });
  const page = await meet(demoUrl ?? talkingUrl);
  const focused = () => page.evaluate(() => document.activeElement!.id);
  const looks = () => page.evaluate(() => window.ico3d!.stage.camera.position.toArray().join());
  expect(await focused()).toBe('start');
  const before = await looks();
  await page.mouse.move(500, 300);
  await page.mouse.down();
  await page.mouse.move(700, 300, { steps: 4 });
  await page.mouse.up();
  await expect.poll(looks).not.toBe(before);
  await page.mouse.click(640, 530); // beside words of the card
  expect(await focused()).toBe('start');
  expect(await page.$eval('#start', (start) => start.matches(':focus-visible'))).toBe(true);

  const stops = [];
  for (let i = 0; i < 5; i++) {
    await page.keyboard.press('Tab');
    stops.push(await focused());
  }
  expect(stops).toEqual(['start-typing', 'stage', 'ai-button', 'panel-button', 'settings-button']);
  const first = await page.$$eval('button, canvas', (all) => all.find((one) => !one.closest('[inert]') && one.checkVisibility())!.id);
  expect(first).toBe('start'); // of those that a screen reader meets

  await page.keyboard.press('Enter');
  await page.selectOption('#language', 'de');
  expect(await page.textContent('#start')).toBe('Gespräch beginnen');
  await page.selectOption('#language', 'en');
  await judge(page, 'invitation with settings');
  await page.setViewportSize({ width: 1280, height: 720 });
  await page.click('#panel-button');
  expect(await page.textContent('#figures')).not.toBe('');
  await page.click('#ai-button');
  expect(await page.isVisible('#origin')).toBe(true);
  await page.keyboard.press('Escape');
  const theme = () => page.evaluate(() => document.body.dataset.theme);
  const was = await theme();
  await page.click('.theme');
  expect(await theme()).not.toBe(was);
  if (demoUrl) {
    await page.click('.views [aria-keyshortcuts="3"]');
    expect(await page.getAttribute('.views [aria-keyshortcuts="3"]', 'aria-pressed')).toBe('true');
  }
  await page.keyboard.press('t');
  expect(await page.isHidden('#drawer')).toBe(true); // nothing was said yet
  expect(await page.$eval('main', (main) => main.inert)).toBe(true);

  await page.focus('#start-typing');
  await page.keyboard.press('Enter');
  await page.waitForSelector('#composer:visible');
  expect(await page.$eval('main', (main) => main.inert)).toBe(false);
});

test('who enters VR before the talk begins it so', async () => {
  browser = await Browser.launch({ width: 240, height: 160 });
  await plugIn(browser.page);
  const page = await meet(talkingUrl, 'webgl');
  await page.getByRole('button', { name: 'Enter VR' }).click();
  await page.waitForFunction(() => window.ico3d!.stage.renderer.xr.isPresenting);
  await page.waitForSelector('#overlay.gone', { state: 'attached' });
  expect(await page.$eval('#composer', (composer) => (composer as HTMLElement).hidden)).toBe(false);
});
