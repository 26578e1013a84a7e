import type { WebSocketRoute } from 'playwright-core';
import { afterEach, expect, inject, test } from 'vitest';
import { judge } from '../../support/browser/axe.ts';
import { Browser } from '../../support/browser/browser.ts';
import { pauseDrawing } from '../../support/browser/drawing.ts';
import { drawnBy } from '../../support/browser/path.ts';
import { keepSound } from '../../support/browser/talk.ts';
import { slowness } from '../../support/slowness.ts';

const { talkingUrl } = inject('shared');

let browser: Browser;
afterEach(() => browser?.close());

test('axe finds nothing serious in any state of the page', async () => {
  browser = await Browser.launch({ width: 1280, height: 720, calm: true });
  const { page } = browser;
  let line: WebSocketRoute | undefined;
  await page.routeWebSocket(/\/ws/, (socket) => {
    line = socket;
    socket.connectToServer().onMessage((message) => socket.send(message));
  });
  await keepSound(page);
  let load = () => {};
  const loading = new Promise<void>((resolve) => (load = resolve));
  await page.route(/bundle\/.*safetensors/, async (route) => {
    await loading;
    await route.continue();
  });
  await page.goto(drawnBy('soft', talkingUrl));
  await page.waitForFunction(() => document.getElementById('overlay-name')!.textContent === 'Stella');
  await judge(page, 'loading');
  await page.keyboard.press('Tab'); // behind the cover nothing can be clicked, so nothing is reached either
  expect(await page.evaluate(() => document.activeElement === document.body)).toBe(true);
  load();
  await page.waitForFunction(() => window.ico3d !== undefined);
  await page.evaluate(() => window.ico3d!.stage.holdQuality(0));
  await page.waitForSelector('[data-there] #choices:visible');
  await pauseDrawing(page);
  await judge(page, 'invitation');
  await page.click('#start-typing');
  await page.waitForFunction(() => document.querySelector('#answer')!.textContent === 'Hello.');
  await page.fill('#text', 'tell me about yourself');
  await page.keyboard.press('Enter');
  await page.waitForFunction(() => /Gaussians/.test(document.querySelector('#answer')!.textContent!));
  await judge(page, 'talking');
  await page.click('#settings-button');
  await judge(page, 'settings');
  await page.click('#panel-button');
  expect(await page.isHidden('#settings')).toBe(true); // there is room for one
  await page.click('#ai-button');
  expect(await page.isHidden('#panel')).toBe(true);
  expect(await page.textContent('#origin dl')).toContain('none needed');
  await judge(page, 'origin');
  await page.keyboard.press('Escape');
  await page.click('#drawer-button');
  await judge(page, 'drawer');
  await page.click('#drawer-close');
  line!.send(JSON.stringify({ type: 'place', session: 'x', position: 3, seconds: 125 }));
  await page.waitForSelector('#overlay-wait:visible');
  await judge(page, 'queue');
  line!.send(JSON.stringify({ type: 'error', message: 'Over.', fatal: true, again: true, code: 'idle', values: { minutes: 5 } }));
  await page.waitForSelector('#again:visible');
  await judge(page, 'ended');
});

test('thousands of notices and of long questions keep nobody', async () => {
  browser = await Browser.launch({ width: 900, height: 700, calm: true });
  const { page } = browser;
  let line: WebSocketRoute | undefined;
  let welcome: object | undefined;
  await page.routeWebSocket(/\/ws/, (socket) => {
    line = socket;
    socket.connectToServer().onMessage((message) => {
      if (typeof message === 'string' && message.includes('"welcome"')) welcome = JSON.parse(message) as object;
      socket.send(message);
    });
  });
  await page.goto(drawnBy('soft', talkingUrl));
  await page.waitForFunction(() => document.querySelector('#answer')!.textContent === 'Hello.');
  await pauseDrawing(page);
  const text = '\u07da\u20dd'.repeat(1990);
  const send = (message: object) => line!.send(JSON.stringify(message));
  const begin = performance.now();
  for (let i = 0; i < 30; i++) send({ ...welcome, resumed: true, notices: Array.from({ length: 300 }, (_, k) => ({ code: 'x', text: `${i} ${k}` })) });
  for (let i = 0; i < 150; i++) send({ type: 'transcript', text: `${text}${i}`, final: true });
  await page.waitForFunction(() => document.getElementById('record')!.textContent!.endsWith('149'));
  expect(performance.now() - begin).toBeLessThan(4000 * slowness())
  expect(await page.locator('#notices p').count()).toBe(5);
  const rows = () => page.locator('#record p').count();
  expect(await rows()).toBeLessThan(60);
  await page.click('#drawer-button');
  await page.waitForFunction(() => document.getElementById('record')!.scrollTop > 0);
  const { scrollTop, scrollHeight, clientHeight } = await page.evaluate(() => {
    const { scrollTop, scrollHeight, clientHeight } = document.getElementById('record')!;
    return { scrollTop, scrollHeight, clientHeight };
  });
  expect(scrollHeight - scrollTop - clientHeight).toBeLessThan(40); // the newest words are seen
  send({ type: 'transcript', text: 'The last one.', final: true });
  await page.waitForFunction(() => {
    const list = document.getElementById('record')!;
    return list.textContent!.endsWith('The last one.') && list.scrollHeight - list.scrollTop - list.clientHeight < 40;
  });
});

test('axe finds nothing serious in the check of the device', async () => {
  browser = await Browser.launch({ width: 1280, height: 720, calm: true });
  const { page } = browser;
  await page.goto(`${talkingUrl}check`);
  await page.waitForSelector('#frames[data-verdict]');
  await page.click('#sound button');
  await page.waitForSelector('#heard:visible');
  await page.click('#unheard');
  await judge(page, 'check');
});
