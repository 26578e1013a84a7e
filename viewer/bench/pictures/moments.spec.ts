/** Four moments of a talk, on a desk and in a hand: what a visitor judges the person by. */
import { join } from 'node:path';
import { inject, test } from 'vitest';
import { Browser } from '../../support/browser/browser.ts';
import { makeVoice } from '../../support/browser/talk.ts';
import { drawnBy } from '../../support/browser/path.ts';
import { scratchFolder } from '../../support/scratch.ts';
import { Album } from './album.ts';
import { arrive, ask, Line } from './visitor.ts';

const SIZES = { desk: { width: 1280, height: 800 }, hand: { width: 390, height: 844 } };
const GESTURE = 1500; // ms from some words on until hands are up
const { demoUrl } = inject('shared');

test('four moments', async () => {
  const album = new Album();
  for (const [place, size] of Object.entries(SIZES)) await moments(album, place, size);
  await album.write('page/moments.jpg', 330);
}, 300_000);

async function moments(album: Album, place: string, size: { width: number; height: number }): Promise<void> {
  const voice = join(scratchFolder(), 'voice.wav');
  makeVoice(voice);
  const browser = await Browser.launch({ ...size, calm: true, microphone: voice });
  const { page } = browser;
  const line = await Line.through(page, /"state": ?"thinking"/);
  await page.emulateMedia({ colorScheme: 'light', reducedMotion: 'no-preference' });
  await browser.open(drawnBy('soft', demoUrl!));
  await page.waitForFunction(() => document.body.dataset.state === 'speaking', undefined, { timeout: 60_000 });
  await page.waitForTimeout(GESTURE);
  await album.shoot(page, `Greeting (${place})`);
  await greetingOver(browser);
  await page.click('#microphone');
  await page.waitForFunction(() => document.body.dataset.state === 'listening', undefined, { timeout: 60_000 });
  await page.waitForTimeout(GESTURE);
  await album.shoot(page, `Listening (${place})`);
  line.hold();
  await page.waitForFunction(() => document.body.dataset.state === 'thinking', undefined, { timeout: 60_000 });
  await page.waitForTimeout(GESTURE);
  await album.shoot(page, `Thinking (${place})`);
  await browser.close();

  const speaking = await arrive(demoUrl!, { ...size, light: true });
  await speaking.page.emulateMedia({ colorScheme: 'light', reducedMotion: 'no-preference' });
  await ask(speaking.page);
  await speaking.page.waitForTimeout(GESTURE);
  await album.shoot(speaking.page, `Speaking, with her hands (${place})`);
  await speaking.close();
}

async function greetingOver({ page }: Browser): Promise<void> {
  await page.waitForFunction(() => document.body.dataset.state === 'idle', undefined, { timeout: 60_000 });
}
