import { join } from 'node:path';
import { afterAll, beforeAll, expect, inject, test } from 'vitest';
import { MICROPHONE_CHUNK, MICROPHONE_RATE } from '../../src/protocol.ts';
import type { Browser } from '../../support/browser/browser.ts';
import { pauseDrawing } from '../../support/browser/drawing.ts';
import { readRecord, type Heard, type Record } from '../../support/browser/recorder.ts';
import { scratchFolder } from '../../support/scratch.ts';
import { StallingLine } from '../../support/servers/stalling.ts';
import { slowness } from '../../support/slowness.ts';
import { quantile } from '../../support/statistics.ts';
import { finished, makeVoice, openPage, until } from '../../support/browser/talk.ts';

const SLOW = 'This device or the line is too slow just now: what you say may not be heard.';
const QUIET = 3000; // ms
const STALL = 8000; // ms: more than a server takes at once of sound that comes late

let line: StallingLine;
let browser: Browser;

beforeAll(async () => {
  const voice = join(scratchFolder(), 'voice.wav');
  makeVoice(voice);
  line = await StallingLine.to(inject('shared').talkingUrl);
  browser = await openPage(line.url, { microphone: voice });
});

afterAll(async () => {
  await browser?.close();
  await line?.stop();
});

test('a network that stalls while the microphone is open is noticed, brings no old sound, and the talk goes on', async () => {
  const { page } = browser;
  await until(browser, finished(0)); // the greeting
  await pauseDrawing(page);
  await page.click('#microphone');
  await until(browser, ({ microphone }) => microphone.length > 60);

  const now = () => page.evaluate(() => performance.now());
  line.stall();
  const stalled = await now();
  await page.waitForFunction((words) => document.getElementById('line')!.textContent === words, SLOW);
  const noticed = await page.waitForFunction(() => document.getElementById('line')!.textContent!.startsWith('There is no connection') && performance.now());
  const gone = ((await noticed.jsonValue()) as number) - stalled;
  console.log(`told after ${Math.round(gone)} ms that nothing comes`);
  await page.waitForTimeout(Math.max(0, STALL - gone));
  const flowed = await now();
  line.flow();
  await page.waitForTimeout(1000);
  const { microphone } = await readRecord(page);
  const during = microphone.filter(({ at }) => at > stalled && at < flowed);
  const after = microphone.filter(({ at }) => at > flowed);
  const late = after.filter((chunk) => recorded(chunk, microphone) < flowed);
  const old = ((during.length + late.length) * MICROPHONE_CHUNK) / MICROPHONE_RATE;
  console.log(`of ${STALL / 1000} s ${during.length} chunks were sent meanwhile and ${late.length} late: ${old.toFixed(2)} s of old sound`);
  expect(old).toBeLessThan(1 + 0.1 * slowness()); // a busy page sees late that the line is full
  expect(gone).toBeLessThan(6000 * slowness());

  const understood = await until(browser, ({ received }) =>
    received.some(({ type, at, final }) => type === 'transcript' && final && at > flowed + 1000),
  );
  await page.waitForSelector('#line', { state: 'hidden' }); // once it is over
  expect(understood.received.filter(({ type }) => type === 'error')).toEqual([]);
  expect(await page.locator('#overlay').getAttribute('class')).toBe('gone');
  expect(await page.locator('#microphone').getAttribute('aria-pressed')).toBe('true');

  // What is numbered was recorded then: live chunks leave the page as long after their sample as before.
  const delay = (chunks: Heard[]) => quantile(chunks.map(({ at, sample }) => at - (1000 * sample) / MICROPHONE_RATE), 0.5);
  const live = understood.microphone.filter(({ at }) => at > flowed + 1000);
  const before = microphone.filter(({ at }) => at < stalled);
  expect(Math.abs(delay(live.slice(-60)) - delay(before))).toBeLessThan(100 * slowness());

  await page.click('#microphone');
  await until(browser, isQuiet); // what was said last would take the place of what is typed
  await page.fill('#text', 'Who are you?');
  await page.keyboard.press('Enter');
  await until(browser, ({ received }) => received.some(({ type, text }) => type === 'answer' && text === 'I am Stella.'));
  const { received } = await readRecord(page);
  const welcomes = received.filter(({ type }) => type === 'welcome').map(({ resumed }) => resumed);
  expect(welcomes.slice(1)).not.toContain(false); // whichever line spoke first went on with the talk
});

/** Whether nothing has come of what was said for some seconds: a busy machine understands late. */
function isQuiet({ received, loudness }: Record): boolean {
  const last = received.findLast(({ type }) => ['transcript', 'answer', 'speech', 'state'].includes(type))!;
  return last.type === 'state' && last.state === 'idle' && loudness.at(-1)!.at > last.at + QUIET;
}

/** When a chunk's last sample was recorded, ms of the page's clock, as the first chunks tell. */
function recorded({ sample }: Heard, microphone: Heard[]): number {
  const offsets = microphone.slice(0, 30).map((chunk) => chunk.at - (1000 * chunk.sample) / MICROPHONE_RATE);
  return quantile(offsets, 0.5) + (1000 * sample) / MICROPHONE_RATE;
}
