import { writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { afterEach, beforeAll, expect, inject, test } from 'vitest';
import type { Browser } from '../../support/browser/browser.ts';
import { pauseDrawing } from '../../support/browser/drawing.ts';
import { runPython } from '../../support/python.ts';
import { microphones, readRecord } from '../../support/browser/recorder.ts';
import { scratchFolder } from '../../support/scratch.ts';
import { ChatServer } from '../../support/servers/server.ts';
import { slowness } from '../../support/slowness.ts';
import { openPage, until } from '../../support/browser/talk.ts';

const folder = scratchFolder();
const silence = join(folder, 'silence.wav');
const { talking, talkingUrl } = inject('shared');
const IDLE = /^Nothing was said for [\d.]+ min/;
const QUEUED = /^You are next/;

const opened: { close(): Promise<void> }[] = [];

beforeAll(() => void runPython('sound/voice.py', silence, '90'));

afterEach(async () => {
  for (const browser of opened.splice(0)) await browser.close();
});

/** A server with these settings, which ends with the test. */
async function serve(...settings: string[]): Promise<string> {
  const file = join(folder, 'talk.toml');
  writeFileSync(file, settings.join('\n'));
  const server = await ChatServer.start(talking, 0, '--settings', file);
  opened.push({ close: () => server.stop() });
  return server.url;
}

/** A page with a silent microphone; the browser is gone before its server. */
async function visit(url: string): Promise<Browser> {
  const browser = await openPage(url, { microphone: silence });
  opened.unshift(browser);
  await pauseDrawing(browser.page);
  return browser;
}

const focused = ({ page }: Browser) => page.evaluate(() => document.activeElement?.id);
/** What the tab keeps of the talk. */
const kept = ({ page }: Browser) => page.evaluate(() => Object.keys(sessionStorage).filter((key) => key.startsWith('ico3d-talk')).map((key) => sessionStorage.getItem(key)));
const pressed = ({ page }: Browser) => page.getAttribute('#microphone', 'aria-pressed');

/** Waits until the overlay says something. */
async function says({ page }: Browser, sentence: RegExp): Promise<void> {
  await page.waitForFunction(
    (sentence) => new RegExp(sentence).test(document.getElementById('overlay-error')!.textContent!),
    sentence.source,
    { timeout: 60_000 },
  );
  expect(await page.locator('#overlay').evaluate((overlay) => (overlay as HTMLElement).inert)).toBe(false);
  expect(await page.isHidden('.portrait')).toBe(true); // nothing is behind the words
}

const goes = ({ page }: Browser) => page.waitForFunction(() => document.getElementById('overlay')!.inert, undefined, { timeout: 60_000 });

test('whoever falls silent makes room; who waits for a place gets it, and both may try again', async () => {
  const idle = 0.04 * Math.min(slowness(), 8); // minutes within which a busy machine gets one question through
  const url = await serve('max_sessions = 1', `idle_minutes = ${idle.toFixed(3)}`);
  const first = await visit(url);
  // The first visitor goes on asking until the second one is there.
  const asking = await first.page.evaluate(() => setInterval(() => window.ico3d!.conversation!.ask('Who are you?'), 500));
  await first.page.click('#microphone');
  await first.page.waitForFunction(() => document.getElementById('microphone')!.ariaPressed === 'true');
  expect(await microphones(first.page)).toEqual(['live']);

  const second = await visit(url);
  await says(second, QUEUED);
  expect(await second.page.textContent('#overlay-wait')).toMatch(/^All places are taken/);
  expect(await second.page.isHidden('#again')).toBe(true);
  for (let i = 0; i < 3; i++) {
    await second.page.keyboard.press('Tab'); // behind the overlay nothing can be reached
    expect(await focused(second)).toMatch(/^(check)?$/);
  }
  await second.page.evaluate(() => window.record!.sockets.at(-1)!.close(4000)); // a short drop
  await second.page.waitForFunction(() => document.getElementById('overlay-wait')!.textContent!.startsWith('The connection was lost. Your place is kept'));
  await until(second, ({ received }) => received.filter(({ type }) => type === 'place').length >= 2, 30_000);
  const places = (await readRecord(second.page)).received.filter(({ type }) => type === 'place');
  expect(new Set(places.map(({ session }) => session)).size).toBe(1);
  await first.page.evaluate((asking) => clearInterval(asking), asking);
  expect(await kept(first)).toEqual([expect.stringContaining('Who are you?')]);

  await says(first, IDLE);
  expect(await kept(first)).toEqual([]); // somebody else may begin the next one
  expect(await first.page.textContent('#again')).toBe('Talk again');
  expect(await focused(first)).toBe('again');
  expect(await first.page.isHidden('#overlay-wait')).toBe(true); // nobody may be there
  expect(await pressed(first)).toBe('false');
  expect(await microphones(first.page)).toEqual(['ended']);

  await goes(second); // by itself
  expect(await focused(second)).toBe('text');
  await second.page.keyboard.type('Who are you?');
  await second.page.keyboard.press('Enter');
  await until(second, ({ received }) => received.some(({ text }) => text === 'I am Stella.'), 30_000);

  await first.page.keyboard.press('Enter');
  await says(first, QUEUED);
  await says(second, IDLE);
  await goes(first);
  await expect.poll(() => first.page.textContent('#record')).not.toContain('Who are you?');
  await expect.poll(() => pressed(first)).toBe('false');
}, 300_000);

test('a server that is gone is told of, and what was typed stays; back again, no old question stands over the new greeting', async () => {
  const server = await ChatServer.start(talking);
  opened.push({ close: () => server.stop() });
  const browser = await visit(server.url);
  const { page } = browser;
  await page.fill('#text', 'Who are you?');
  await page.keyboard.press('Enter');
  await until(browser, ({ received }) => received.some(({ text }) => text === 'I am Stella.'), 60_000);
  await page.click('#microphone');
  await page.waitForFunction(() => document.getElementById('microphone')!.ariaPressed === 'true');

  await server.kill();
  await page.waitForSelector('#line:visible:text-is("There is no connection to the server; trying again …")', { timeout: 30_000 }); // the load of a busy machine shows too late
  await expect.poll(() => pressed(browser)).toBe('false');
  await expect.poll(() => page.getAttribute('#microphone', 'title')).toMatch(/^The microphone waits for the connection/);
  expect(await page.getAttribute('#send', 'aria-disabled')).toBe('true');
  await page.fill('#text', 'Are you there?');
  await page.keyboard.press('Enter');
  expect(await page.textContent('#notices')).toMatch(/There is no connection just now: your question stays here/); // maybe behind a notice that the machine is slow

  const next = await ChatServer.start(talking, Number(new URL(server.url).port));
  opened.push({ close: () => next.stop() });
  await page.waitForSelector('#line', { state: 'hidden', timeout: 60_000 });
  expect([await page.textContent('#question'), await page.inputValue('#text')]).toEqual(['', 'Are you there?']);
  await expect.poll(() => page.textContent('#notices')).toContain('The microphone is off now: turn it on to speak.');
  await expect.poll(async () => [await pressed(browser), await page.getAttribute('#send', 'aria-disabled')]).toEqual(['false', 'false']);
});

test('a microphone whose worklet does not load is shown as closed, and is', async () => {
  const browser = await visit(talkingUrl);
  const { page } = browser;
  await page.evaluate(() => {
    const { prototype } = AudioWorklet;
    const { addModule } = prototype;
    prototype.addModule = function (url) {
      prototype.addModule = addModule; // the next time it is there
      return addModule.call(this, `${url}.missing`);
    };
  });
  await page.click('#microphone');
  await page.waitForSelector('#notices p');
  expect(await microphones(page)).toEqual(['ended']);
  expect(await pressed(browser)).toBe('false');
  expect(await page.textContent('#notices')).toBe('The microphone could not be started; try again, or type instead.');

  await page.dblclick('#microphone');
  await page.waitForFunction(() => document.getElementById('microphone')!.ariaPressed === 'true');
  expect(await microphones(page)).toEqual(['ended', 'live']);
  await until(browser, ({ microphone }) => microphone.length > 10, 30_000);
  await page.click('#microphone');
  expect(await pressed(browser)).toBe('false');
  expect(await microphones(page)).toEqual(['ended', 'ended']);
});

test('the visitor ends the talk, and nothing is heard or said until they begin another; sound that stays off is told', async () => {
  const visitor = await visit(talkingUrl);
  const { page } = visitor;
  await page.click('#microphone');
  await page.waitForFunction(() => document.getElementById('microphone')!.ariaPressed === 'true');
  await page.focus('#stage');
  await page.keyboard.press('m');
  await page.click('#settings-button');
  await page.click('#hang-up');
  await says(visitor, /^You have ended this conversation\.$/);
  expect([await microphones(page), await focused(visitor), await page.isVisible('#settings')]).toEqual([['ended'], 'again', false]);
  const said = (await readRecord(page)).received.length;
  await page.waitForTimeout(1000);
  expect((await readRecord(page)).received.length).toBe(said);

  await page.click('#again');
  await goes(visitor);
  await until(visitor, ({ received }) => received.filter(({ type }) => type === 'welcome').length === 2);
  expect(await pressed(visitor)).toBe('false');
  await page.reload();
  await page.waitForFunction(() => document.getElementById('notices')!.textContent!.includes('sound is off: the loudspeaker button'));
});
