/** What is around the picture, in sizes, themes and languages. */
import { inject, test } from 'vitest';
import { Album } from './album.ts';
import { arrive, ask, silent, type Visit } from './visitor.ts';

const { demoUrl } = inject('shared');
const PHONE = { width: 390, height: 844 };
const DESKTOP = { width: 900, height: 640 };
const SMALL = { width: 360, height: 640 };

test('sheets', async () => {
  const album = new Album();
  const desktop = await arrive(demoUrl!, DESKTOP);
  const { page } = desktop;
  await ask(page, 'Who are you?');
  await page.click('#panel-button');
  await album.shoot(page, 'Figures');
  await page.click('#panel-button');
  await page.click('#settings-button');
  await album.shoot(page, 'Settings');
  await page.keyboard.press('Escape');
  await desktop.close();
  const light = await arrive(demoUrl!, { width: 1120, height: 640, light: true });
  await ask(light.page);
  await light.page.click('#drawer-button');
  await album.shoot(light.page, 'The transcript, on a light page');
  await light.close();
  for (const [button, caption] of [['panel', 'Figures on a phone of 360 pixels'], ['settings', 'Settings there'], ['drawer', 'The transcript there']] as const) {
    const phone = await arrive(demoUrl!, { ...SMALL, light: button === 'settings' });
    await ask(phone.page, 'Who are you?');
    await phone.page.click(`#${button}-button`);
    await phone.page.waitForTimeout(1200); // the panel counts pictures for a second
    await album.shoot(phone.page, caption);
    await phone.close();
  }
  await album.write('page/sheets.jpg', 340);
});

test('sizes', async () => {
  const album = new Album();
  const sizes: [string, Visit, string?][] = [
    ['390 × 844', PHONE],
    ['360 × 640, light', { ...SMALL, light: true }],
    ['844 × 390', { width: 844, height: 390 }],
    ['2560 × 1080', { width: 2560, height: 1080 }],
  ];
  for (const [caption, visit] of sizes) {
    const browser = await arrive(demoUrl!, visit);
    await ask(browser.page);
    await album.shoot(browser.page, caption);
    await browser.close();
  }
  await album.write('page/sizes.jpg', 400);
});

test('views', async () => {
  const album = new Album();
  const views: [string, Visit, string][] = [
    ['Face', {}, '1'],
    ['Whole figure, on a light page', { light: true }, '3'],
    ['Head and chest', PHONE, '2'],
    ['Whole figure', PHONE, '3'],
  ];
  for (const [caption, visit, key] of views) {
    const browser = await arrive(demoUrl!, visit);
    await browser.page.click(`.views [aria-keyshortcuts='${key}']`);
    await browser.page.mouse.move(0, 0);
    await silent(browser.page);
    await browser.page.waitForTimeout(500);
    await album.shoot(browser.page, caption);
    await browser.close();
  }
  await album.write('page/views.jpg', 380);
});

test('languages', async () => {
  const album = new Album();
  const german = await arrive(demoUrl!, { language: 'de', light: true, width: 1120, height: 640 });
  await ask(german.page);
  await german.page.click('#drawer-button');
  await album.shoot(german.page, 'German, with the drawer open');
  await german.close();
  const french = await arrive(demoUrl!, { language: 'fr', light: true, ...SMALL });
  await ask(french.page);
  await album.shoot(french.page, 'French');
  await french.close();
  await album.write('page/languages.jpg', 480);
});

test('the page that checks a device', async () => {
  const album = new Album();
  for (const [caption, visit] of [['Dark', {}], ['Light', { light: true }], ['On a phone', { ...PHONE, light: true }]] as [string, Visit][]) {
    const browser = await arrive(`${demoUrl!}check`, { ...visit, typing: false });
    const { page } = browser;
    for (const id of ['secure', 'graphics', 'frames', 'socket', 'headset']) await page.waitForSelector(`#${id}[data-verdict]`, { timeout: 30_000 });
    await album.shoot(page, caption);
    await browser.close();
  }
  await album.write('page/check.jpg', 380);
});
