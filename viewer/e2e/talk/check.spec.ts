import { join } from 'node:path';
import { afterEach, beforeAll, expect, inject, test } from 'vitest';
import { Browser } from '../../support/browser/browser.ts';
import { CARD, pretendCard } from '../../support/browser/path.ts';
import { runPython } from '../../support/python.ts';
import { scratchFolder } from '../../support/scratch.ts';

const voice = join(scratchFolder(), 'check.wav');
const { talkingUrl } = inject('shared');
let browser: Browser;

beforeAll(() => void runPython('sound/voice.py', voice, '0', 'testing testing one two three', '0.2'));
afterEach(() => browser.close());

const verdict = (id: string) => browser.page.getAttribute(`#${id}`, 'data-verdict');
const words = (id: string) => browser.page.textContent(`#${id} .words`);
const judged = (id: string) => browser.page.waitForSelector(`#${id}[data-verdict]`);

/** Waits for the checks that need nobody. */
async function allJudged(): Promise<void> {
  for (const id of ['secure', 'graphics', 'frames', 'socket', 'headset']) await judged(id);
}

/** Opens the page of checks. */
async function check(microphone?: string): Promise<string[]> {
  browser = await Browser.launch({ width: 390, height: 844, microphone });
  const scripts: string[] = [];
  browser.page.on('response', (response) => response.url().endsWith('.js') && scripts.push(response.url()));
  await pretendCard(browser.context);
  await browser.page.goto(`${talkingUrl}check`);
  await allJudged();
  return scripts;
}

test('each line says what is so; microphone and sound are tried, and the report can be copied', async () => {
  const scripts = await check(voice);
  const { page } = browser;
  expect(await verdict('secure')).toBe('good');
  expect(await page.evaluate(() => document.elementFromPoint(60, 200)!.closest('main, body')!.tagName)).toBe('MAIN'); // seen, not only there
  expect([await verdict('graphics'), await words('graphics')]).toEqual(['good', `WebGL 2, drawn by ${CARD}.`]);
  expect(await words('frames')).toMatch(/^\d+ frames? per second/);
  expect(await words('socket')).toMatch(/^The server answers within [\d.]+ ms/);
  expect(['none', 'good']).toContain(await verdict('headset'));
  for (const script of scripts) expect((await (await page.request.get(script)).body()).length, script).toBeLessThan(120_000); // the texts of six languages have 90,000, three has 700,000

  await page.click('#microphone button');
  await page.waitForFunction(() => document.querySelector<HTMLMeterElement>('#microphone meter')!.value > 0.01);
  await judged('microphone');
  expect([await verdict('microphone'), await words('microphone')]).toEqual(['good', 'The microphone hears you.']);

  await page.click('#sound button');
  await page.waitForSelector('#heard:visible');
  expect(await page.evaluate(() => document.activeElement!.id)).toBe('heard');
  await page.click('#unheard');
  expect([await verdict('sound'), await page.textContent('#sound .advice')]).toEqual(['bad', expect.stringContaining('volume')]);
  expect(await page.textContent('#summary')).toBe('Something does not work: see below what to do.');

  const report = await page.inputValue('#report');
  expect(report).toContain('Sound: bad – You did not hear the tone.');
  expect(report).toContain('Microphone: good');
  expect(report).not.toMatch(/127\.0\.0\.1|localhost|:\d{4}|[0-9a-f]{32}/); // no addresses, no ids of devices
  await page.click('#copy');
  expect(await page.textContent('#copy')).toBe('Copied');
  expect(await page.evaluate(() => document.documentElement.scrollWidth - innerWidth)).toBeLessThanOrEqual(0);
  await page.evaluate(() => document.body.append(document.createElement('textarea')));
  await page.focus('body > textarea');
  await page.keyboard.press('Control+V');
  expect(await page.inputValue('body > textarea')).toBe(report);
});

test('a refused microphone and a server that is gone are told, with what to do', async () => {
  browser = await Browser.launch({ width: 390, height: 844 });
  const { page } = browser;
  await page.routeWebSocket(/echo$/, (socket) => socket.close());
  await page.addInitScript(() => {
    Object.defineProperty(window, 'localStorage', {
      get() {
        throw new DOMException('refused', 'SecurityError'); // as where all that pages keep is blocked
      },
    });
    navigator.mediaDevices.getUserMedia = () => Promise.reject(new DOMException('refused', 'NotAllowedError'));
  });
  await page.goto(`${talkingUrl}check`);
  await allJudged();
  await page.selectOption('#language', 'de'); // kept nowhere
  expect(await page.textContent('h1')).toBe('Dieses Gerät prüfen');
  await page.selectOption('#language', 'en');
  expect([await verdict('graphics'), await words('graphics')]).toEqual(['fair', expect.stringMatching(/^The processor draws.*(SwiftShader|llvmpipe)/)]);
  expect([await verdict('frames'), await words('frames')]).toEqual(['none', 'Nothing to count: no graphics card draws.']);
  expect([await verdict('socket'), await page.textContent('#socket .advice')]).toEqual(['bad', expect.stringContaining('firewall')]);
  await page.click('#microphone button');
  await judged('microphone');
  expect(await verdict('microphone')).toBe('bad');
  expect(await words('microphone')).toMatch(/^The microphone is blocked for this page/);
  expect(await page.textContent('#microphone .advice')).toMatch(/^Allow it/);
});
