/** Four moments of a talk, on a desk and in a hand: what a visitor judges the person by. */
import { join } from 'node:path';
import type { Page } from 'playwright-core';
import { expect, inject, test } from 'vitest';
import type { Cue } from '../../src/protocol.ts';
import { Browser } from '../../support/browser/browser.ts';
import { makeVoice } from '../../support/browser/talk.ts';
import { drawnBy } from '../../support/browser/path.ts';
import { scratchFolder } from '../../support/scratch.ts';
import { Album, publish } from './album.ts';
import { ask, Line, QUESTION, silent } from './visitor.ts';

const SIZES = { desk: { width: 1280, height: 800 }, hand: { width: 390, height: 844 } };
const BOTH_HANDS = ['small', 'big', 'open_hands', 'welcome'];
const ATTENTION = 1500; // ms from the beginning of listening, or of thinking, until it shows
const { demoUrl } = inject('shared');

interface Told {
  utterance: number;
  cue: Cue;
}

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
  const cues = listen(line);
  await page.emulateMedia({ colorScheme: 'light', reducedMotion: 'no-preference' });
  await browser.open(drawnBy('soft', demoUrl!));
  await atStroke(page, cues, 0, () => true);
  if (place === 'desk') await publish(page, 'demo.jpg'); // the README's first
  await album.shoot(page, `Greeting (${place})`);
  await silent(page);
  await ask(page, QUESTION);
  await atStroke(page, cues, 1, (name) => BOTH_HANDS.includes(name));
  await album.shoot(page, `Speaking, with her hands (${place})`);
  await silent(page);
  await page.click('#microphone');
  await page.waitForFunction(() => document.body.dataset.state === 'listening', undefined, { timeout: 60_000 });
  await page.waitForTimeout(ATTENTION);
  await album.shoot(page, `Listening (${place})`);
  line.hold();
  await page.waitForFunction(() => document.body.dataset.state === 'thinking', undefined, { timeout: 60_000 });
  await page.waitForTimeout(ATTENTION);
  await album.shoot(page, `Thinking (${place})`);
  await browser.close();
}

/** Gestures that the server has told so far. */
function listen(line: Line): Told[] {
  const told: Told[] = [];
  line.onText = (text) => {
    const message = JSON.parse(text);
    if (message.type === 'cues') told.push(...message.cues.map((cue: Cue) => ({ utterance: message.utterance, cue })));
  };
  return told;
}

/** Waits until the first such gesture of an utterance is at its stroke. */
async function atStroke(page: Page, told: Told[], utterance: number, wanted: (name: string) => boolean): Promise<void> {
  const found = () => told.find((one) => one.utterance === utterance && wanted(one.cue.name));
  await expect.poll(found, { timeout: 60_000 }).toBeDefined();
  await page.waitForFunction(
    ([utterance, stroke]) => {
      const heard = window.ico3d!.conversation!.player.heard();
      return heard?.utterance === utterance && heard.seconds >= stroke;
    },
    [utterance, found()!.cue.stroke],
    { polling: 'raf' },
  );
}
