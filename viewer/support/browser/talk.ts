import { existsSync } from 'node:fs';
import { join } from 'node:path';
import type { Page } from 'playwright-core';
import { Browser, type BrowserOptions } from './browser.ts';
import { drawSeldom } from './drawing.ts';
import { drawnBy, type Path } from './path.ts';
import { PATIENCE } from '../patience.ts';
import { REPOSITORY, runPython } from '../python.ts';
import { readRecord, recordLoudness, recordWire, type Record } from './recorder.ts';

export const SENTENCE = 'we must find a new home in the stars'; // the persona of persona.json has a long answer to it
export const SHORTER = 'tell me about yourself'; // and one of some seconds to this
const RECORDING = join(REPOSITORY, '../shared/speech/new-home-in-the-stars-16k.wav');

export const VOICE = 0.005; // level of the microphone above which somebody speaks
export const SILENCE = 1e-4; // level of the avatar under which nothing is heard

/**
 * Opens the page of a server in a small window that draws nothing by itself, and records its conversation.
 * The server has answered then: what is typed is sent, unless there is no place yet.
 *
 * @param path what draws where a test asks for a picture; without Spark a page starts with half of the work
 */
export async function openPage(url: string, options: BrowserOptions = {}, path: Path = 'soft'): Promise<Browser> {
  const browser = await Browser.launch({ width: 320, height: 240, ...options });
  await recordWire(browser.context);
  await browser.open(drawnBy(path, url));
  await drawSeldom(browser.page);
  await recordLoudness(browser.page);
  await until(browser, ({ received }) => received.length > 0);
  return browser;
}

/** Waits until the recorded conversation fulfils a condition; then gives the record. */
export async function until(browser: Browser, condition: (record: Record) => boolean, timeout = PATIENCE): Promise<Record> {
  for (const end = Date.now() + timeout; Date.now() < end; ) {
    const record = await readRecord(browser.page);
    if (condition(record)) return record;
    await browser.page.waitForTimeout(100);
  }
  throw new Error(`not within ${timeout} ms: ${condition}`);
}

/** Whether all of an utterance has been said and heard. */
export const finished = (utterance: number) => ({ received }: Record) => {
  const end = received.findIndex((m) => m.type === 'end' && m.utterance === utterance);
  return end >= 0 && received.slice(end).findLast(({ type }) => type === 'state')?.state === 'idle';
};

/** When the visitor began to speak for the last time before `end`, after at least a second's pause. */
export function lastOnset({ microphone }: Record, end: number): number {
  const voiced = microphone.filter(({ at, level }) => at < end && level > VOICE);
  return voiced.findLast(({ at }, i) => i === 0 || at - voiced[i - 1]!.at > 1000)!.at;
}

/** A WAV in which the sentence is said, by default again and again: on a busy machine nobody knows when the answer will come. */
export function makeVoice(path: string, times = 8): void {
  const sentence = existsSync(RECORDING) ? RECORDING : SENTENCE;
  runPython('sound/voice.py', path, '2', ...Array.from({ length: times }, () => [sentence, '4.5']).flat());
}

/** Sound waits for a click, as in browsers that are not tested; before the page is opened. */
export function keepSound(page: Page): Promise<unknown> {
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

/** Captions stay from now on, also after an answer: what they cover is measured in peace. */
export function keepCaptions(page: Page): Promise<void> {
  return page.evaluate(() => {
    const captions = document.getElementById('captions')!;
    captions.hidden = false;
    captions.classList.remove('gone');
    captions.classList.add = () => {};
    Object.defineProperty(captions, 'hidden', { get: () => false, set: () => {} });
  });
}
