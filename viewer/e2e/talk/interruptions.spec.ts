import { join } from 'node:path';
import { afterEach, beforeAll, expect, inject, test } from 'vitest';
import { Browser } from '../../support/browser/browser.ts';
import { pauseDrawing } from '../../support/browser/drawing.ts';
import { drawnBy } from '../../support/browser/path.ts';
import { microphones, readRecord, recordWire } from '../../support/browser/recorder.ts';
import { until } from '../../support/browser/talk.ts';
import { runPython } from '../../support/python.ts';
import { scratchFolder } from '../../support/scratch.ts';

const silence = join(scratchFolder(), 'interrupted.wav');
const { talkingUrl } = inject('shared');
let browser: Browser;

declare global {
  interface Window {
    locks?: WakeLockSentinel[];
  }
}

beforeAll(() => void runPython('sound/voice.py', silence, '60'));
afterEach(() => browser.close());

test('sound and microphone that the system takes away come back, and the screen stays on only while somebody talks', async () => {
  browser = await Browser.launch({ microphone: silence });
  const { page } = browser;
  await recordWire(browser.context);
  await browser.context.addInitScript(() => {
    window.locks = [];
    const { request } = WakeLock.prototype;
    WakeLock.prototype.request = async function (type) {
      const lock = await request.call(this, type);
      window.locks!.push(lock);
      return lock;
    };
  });
  await browser.open(drawnBy('soft', talkingUrl));
  await pauseDrawing(page);
  const sound = () => page.evaluate(() => window.ico3d!.conversation!.player.context.state);
  const opened = () => page.waitForFunction(() => document.getElementById('microphone')!.ariaPressed === 'true');

  await page.evaluate(() => window.ico3d!.conversation!.player.context.suspend());
  await page.waitForFunction(() => window.ico3d!.conversation!.player.context.state === 'running');
  expect(await page.isHidden('#silenced')).toBe(true);

  await page.evaluate(() => {
    const { context } = window.ico3d!.conversation!.player;
    context.resume = () => Promise.reject(new DOMException('a call', 'InvalidStateError')); // as iOS does while it lasts
    return context.suspend();
  });
  await page.waitForSelector('#silenced:visible');
  expect(await page.textContent('#silenced')).toBe('Sound was interrupted. Tap anywhere to go on.');
  await page.evaluate(() => delete (window.ico3d!.conversation!.player.context as Partial<AudioContext>).resume);
  await page.click('#stage', { position: { x: 160, y: 60 } });
  await page.waitForSelector('#silenced', { state: 'hidden' });
  expect(await sound()).toBe('running');

  await page.click('#microphone');
  await opened();
  await page.waitForFunction(() => window.locks!.some(({ released }) => !released));
  await page.evaluate(() => {
    const [track] = window.record!.streams[0]!.getTracks();
    track!.stop();
    track!.dispatchEvent(new Event('ended')); // what an unplugged headset brings
  });
  await page.waitForFunction(() => document.getElementById('microphone')!.ariaPressed === 'false');
  await opened();
  expect(await microphones(page)).toEqual(['ended', 'live']);
  expect(await page.locator('#notices p').allTextContents()).toContain('The microphone is on again.');
  const before = (await readRecord(page)).microphone.length;
  await until(browser, ({ microphone }) => microphone.length > before + 5);

  await page.click('#microphone');
  await page.waitForFunction(() => document.body.dataset.state === 'idle');
  await page.waitForFunction(() => window.locks!.every(({ released }) => released));
});
