import { join } from 'node:path';
import { afterAll, beforeAll, describe, expect, inject, test } from 'vitest';
import type { Browser } from '../support/browser/browser.ts';
import { hasClip, makePortrait, makeStandIn } from '../support/references/portrait.ts';
import { readMouth, watchMouth } from '../support/browser/mouth.ts';
import type { Loudness, Record } from '../support/browser/recorder.ts';
import { scratchFolder } from '../support/scratch.ts';
import { ChatServer } from '../support/servers/server.ts';
import { slowness } from '../support/slowness.ts';
import { correlation, quantile } from '../support/statistics.ts';
import { finished, lastOnset, makeVoice, openPage, SENTENCE, SILENCE, until } from '../support/browser/talk.ts';

const folder = scratchFolder();
const LONG_ENOUGH = 2000; // ms of speech that the mouth is watched for
const MOST_ANSWERS = 5; // that are watched for
const EASED = 700; // ms until the face rests after it has been silenced

describe(hasClip ? 'from a video of a person to a talk with the avatar' : 'a talk with the avatar', () => {
  let server: ChatServer;
  let browser: Browser;
  let record: Record;

  beforeAll(async () => {
    server = await ChatServer.start(hasClip ? makePortrait(folder) : makeStandIn(folder, inject('shared').demo));
    const voice = join(folder, 'voice.wav');
    makeVoice(voice);
    browser = await openPage(server.url, { microphone: voice, calm: true }, 'webgl');
    await until(browser, finished(0)); // the greeting
    await browser.page.waitForFunction(() => window.ico3d!.conversation!.player.heard() === null);
    await browser.page.waitForTimeout(EASED + 300);
    await watchMouth(browser.page);
    await browser.page.click('#microphone');
  }, 600_000); // it learns a face

  afterAll(async () => {
    await browser?.close();
    await server?.stop();
  });

  test('a spoken question is understood and answered aloud', async () => {
    const { page } = browser;
    const speaking = ({ loudness }: Record) => loudness.slice(-20).every(({ level }) => level > SILENCE);
    await until(browser, speaking); // who is late is interrupted by the question that comes next
    const question = (await page.locator('#question').textContent())!;
    console.log(`understood: ${question}`);
    const understood = question.split(' ').filter((word) => SENTENCE.split(' ').includes(word));
    expect(understood.length).toBeGreaterThan(2);
    expect(await page.locator('#answer').textContent()).not.toBe('');
    expect(await page.locator('#figures').textContent()).toMatch(/question to answer\d+ ms/);
  });

  test('the next question silences the answer', async () => {
    await until(browser, ({ received }) => received.some(({ type }) => type === 'stop'));
    record = await until(browser, ({ received, loudness }) => {
      const stop = received.find(({ type }) => type === 'stop')!;
      return loudness.at(-1)!.at > stop.at + EASED + 1000;
    });
    const stop = record.received.find(({ type }) => type === 'stop')!;
    const onset = lastOnset(record, stop.at); // of the words that interrupt
    const silent = record.loudness.findLast(({ at, level }) => at < stop.at + 290 && level > SILENCE)!;
    console.log(`silent ${Math.round(silent.at - onset)} ms after the first sound of the second question`);
    expect(silent.at - onset).toBeLessThan(600 * slowness());
  });

  test('the mouth moves with the sound, and only then', async () => {
    // The sentence is said again and again: where answers come late, or few pictures are drawn, several of them are watched.
    const since = (await readMouth(browser.page)).sights[0]!.at;
    let seen = await watched(since, LONG_ENOUGH);
    for (let more = 2; more <= MOST_ANSWERS && seen.during.length <= 2; more++) seen = await watched(since, more * LONG_ENOUGH);
    const { together, during, rest } = seen;
    const moving = quantile(during, 0.5);
    const still = quantile(rest, 0.9);
    console.log(
      `face and loudness correlate by ${together.toFixed(2)}; pictures of the mouth differ by ` +
        `${moving.toFixed(1)} levels while it speaks (${during.length}), ${still.toFixed(1)} at rest (${rest.length})`,
    );
    expect(together).toBeGreaterThan(0.5);
    expect(during.length).toBeGreaterThan(2);
    expect(rest.length).toBeGreaterThan(2);
    expect(moving).toBeGreaterThan(3 * still + 1);
  });

  /** What was seen and heard since a moment, once she has spoken for so many ms. */
  async function watched(since: number, ms: number): Promise<{ together: number; during: number[]; rest: number[] }> {
    const { loudness } = await until(browser, (record) => spoken(record, since) > ms);
    const { sights, pictures } = await readMouth(browser.page);
    const end = loudness.at(-1)!.at;
    const before = sights.filter(({ at }) => at < end);
    const together = correlation(before.map(({ at }) => heard(loudness, at)), before.map(({ speech }) => speech));
    /** What changed in the pictures before which it was heard, or not, all of the time. */
    const changes = (audible: boolean, before: number) =>
      pictures
        .filter(({ at }) => {
          const levels = loudness.filter((one) => one.at > at - before && one.at < at);
          return at < end && levels.length > 0 && levels.every(({ level }) => level > SILENCE === audible);
        })
        .map(({ change }) => change);
    return { together, during: changes(true, 200), rest: changes(false, EASED) };
  }
});

/** For how many ms the avatar was heard since a moment. */
function spoken({ loudness }: Record, since: number): number {
  const times = loudness.filter(({ at, level }) => at > since && level > SILENCE).map(({ at }) => at);
  return times.slice(1).reduce((sum, at, i) => sum + Math.min(at - times[i]!, 100), 0);
}

/** How loud the avatar is within 0.2 s of a moment. */
function heard(loudness: Loudness[], moment: number): number {
  const near = loudness.filter(({ at }) => Math.abs(at - moment) < 200);
  return near.reduce((sum, { level }) => sum + level, 0) / Math.max(1, near.length);
}
