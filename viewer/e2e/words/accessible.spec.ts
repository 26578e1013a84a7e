import { createRequire } from 'node:module';
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import type { AxeResults } from 'axe-core';
import type { Page, WebSocketRoute } from 'playwright-core';
import { afterEach, expect, inject, test } from 'vitest';
import { Browser } from '../../support/browser/browser.ts';
import { pauseDrawing } from '../../support/browser/drawing.ts';

const AXE = readFileSync(createRequire(import.meta.url).resolve('axe-core/axe.min.js'), 'utf8');
const { talkingUrl } = inject('shared');
const DESKTOP = { width: 1280, height: 720 };
const PHONE = { width: 360, height: 640 };

let browser: Browser;
afterEach(() => browser?.close());

/** What axe finds that keeps somebody out. */
async function findings(page: Page, rules?: string[]): Promise<string[]> {
  if (!(await page.evaluate(() => 'axe' in window))) await page.evaluate(AXE);
  const { violations } = (await page.evaluate((rules) => {
    const { axe } = window as unknown as { axe: typeof import('axe-core') };
    const asked: import('axe-core').RunOptions = rules ? { runOnly: rules } : { rules: { 'target-size': { enabled: true } } };
    return axe.run(document, { ...asked, resultTypes: ['violations'] });
  }, rules)) as AxeResults;
  return violations
    .filter(({ impact }) => impact === 'serious' || impact === 'critical')
    .flatMap(({ id, nodes }) => nodes.map(({ target, failureSummary }) => `${id}: ${target.join(' ')} ${failureSummary}`));
}

/** Looks at a state on a desktop in the dark and on a phone in the light, and at the colours of the other two. */
async function judge(page: Page, state: string): Promise<void> {
  for (const [size, colorScheme, rules] of [
    [DESKTOP, 'dark', undefined],
    [DESKTOP, 'light', ['color-contrast']],
    [PHONE, 'dark', ['color-contrast']],
    [PHONE, 'light', undefined],
  ] as const) {
    await page.setViewportSize(size);
    await page.emulateMedia({ colorScheme, reducedMotion: 'reduce' });
    await page.waitForFunction((theme) => (document.body.dataset.theme ?? theme) === theme, colorScheme);
    if (process.env.PICTURES) await page.screenshot({ path: join(process.env.PICTURES, `${state}-${size.width}-${colorScheme}.png`) });
    const found = await findings(page, rules && [...rules]);
    expect.soft(found, `${state}, ${size.width} px, ${colorScheme}`).toEqual([]);
    const wide = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
    expect.soft(wide, state).toBeLessThanOrEqual(0);
  }
}

/** Sound waits for a click, as in browsers that are not tested. */
function keepSound(page: Page): Promise<unknown> {
  return page.addInitScript(() => {
    const state = Object.getOwnPropertyDescriptor(BaseAudioContext.prototype, 'state')!;
    let clicked = false;
    addEventListener('click', () => (clicked = true), { capture: true, once: true });
    const get = function (this: AudioContext) {
      return clicked ? state.get!.call(this) : 'suspended';
    };
    Object.defineProperty(AudioContext.prototype, 'state', { configurable: true, get });
  });
}

test('axe finds nothing serious in any state of the page', async () => {
  browser = await Browser.launch({ ...DESKTOP, calm: true });
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
  await page.goto(talkingUrl);
  await page.waitForFunction(() => document.getElementById('overlay-name')!.textContent === 'Stella');
  await judge(page, 'loading');
  load();
  await page.waitForFunction(() => window.ico3d !== undefined, undefined, { timeout: 60_000 });
  await page.evaluate(() => window.ico3d!.stage.holdQuality(0));
  await pauseDrawing(page);
  await page.waitForSelector('#choices:visible');
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

test('axe finds nothing serious in the check of the device', async () => {
  browser = await Browser.launch({ ...DESKTOP, calm: true });
  const { page } = browser;
  await page.goto(`${talkingUrl}check`);
  await page.waitForSelector('#frames[data-verdict]');
  await page.click('#sound button');
  await page.waitForSelector('#heard:visible');
  await page.click('#unheard');
  await judge(page, 'check');
});

test('axe finds nothing serious in an embedded avatar', async () => {
  browser = await Browser.launch({ ...DESKTOP, calm: true });
  const { page } = browser;
  await keepSound(page);
  const html = `<!doctype html><html lang="de"><title>Site</title><main><h1>Site</h1>
    <ico3d-avatar lang="fr" style="max-width: 100%"></ico3d-avatar><ico3d-avatar mode="floating"></ico3d-avatar></main>
    <script type="module" src="embed.js"></script></html>`;
  await page.route(`${talkingUrl}site`, (route) => route.fulfill({ contentType: 'text/html', body: html }));
  await page.goto(`${talkingUrl}site`);
  const avatar = page.locator('ico3d-avatar').first();
  await avatar.locator('#choices').waitFor();
  expect(await avatar.locator('#start').textContent()).toBe('Commencer à parler'); // as the element says
  expect(await avatar.locator('#page').getAttribute('lang')).toBe('fr');
  expect(await page.locator('#launcher').last().getAttribute('aria-label')).toBe('Talk with the avatar');
  await judge(page, 'embedded-invitation');
  await avatar.locator('#start-typing').click();
  await avatar.locator('#drawer-button').click();
  await page.waitForTimeout(5000); await page.screenshot({path:'/tmp/words/dbg.png'}); console.log(await avatar.evaluate((a) => a.shadowRoot!.querySelector('#page')!.outerHTML.slice(0,300)), await avatar.locator('#record').innerHTML(), await avatar.locator('#overlay').getAttribute('class'));
  await avatar.locator('#record .avatar').waitFor({timeout:3000});
  expect(await avatar.locator('#state').textContent()).toMatch(/^(Parle|Prêt)$/);
  await page.evaluate(() => (document.querySelector('ico3d-avatar')!.lang = 'ja'));
  expect(await avatar.locator('#drawer h2').textContent()).toBe('会話の記録');
  expect(await page.evaluate(() => document.documentElement.lang)).toBe('de'); // the site's own
  await judge(page, 'embedded');
});
