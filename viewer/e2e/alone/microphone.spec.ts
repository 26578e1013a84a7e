import { join } from 'node:path';
import { afterAll, beforeAll, expect, test } from 'vitest';
import { MICROPHONE_RATE } from '../../src/protocol.ts';
import type { Browser } from '../../support/browser/browser.ts';
import type { Heard } from '../../support/browser/recorder.ts';
import { finished, makeVoice, openPage, until } from '../../support/browser/talk.ts';
import { runPython } from '../../support/python.ts';
import { scratchFolder } from '../../support/scratch.ts';
import { ChatServer } from '../../support/servers/server.ts';
import { ms, quantile } from '../../support/statistics.ts';

const SECONDS = 6; // of an answer that are looked at
const BUSY = 120; // ms of work
const EVERY = 300; // ms
const FORGIVEN = 0.06; // s, by the server's echo guard

const folder = scratchFolder();
let server: ChatServer;
let browser: Browser;

beforeAll(async () => {
  const [bundle, voice] = [join(folder, 'talking.ico3d'), join(folder, 'voice.wav')];
  runPython('references/talking_bundle.py', bundle);
  makeVoice(voice, 1);
  server = await ChatServer.start(bundle);
  browser = await openPage(server.url, { microphone: voice, calm: true });
  await until(browser, finished(0)); // the greeting
});

afterAll(async () => {
  await browser?.close();
  await server?.stop();
});

test('the microphone says what the loudspeaker plays, however busy the page is', async () => {
  const { page } = browser;
  await page.evaluate(
    ({ BUSY, EVERY }) =>
      setInterval(() => {
        for (const begun = performance.now(); performance.now() - begun < BUSY; );
      }, EVERY),
    { BUSY, EVERY },
  );
  await page.click('#microphone');
  const { microphone } = await until(browser, ({ microphone }) => seconds(answer(microphone)) > SECONDS);
  const chunks = answer(microphone);
  // One constant, for both run in real time but for the silence of late pieces; not even late messages change it.
  const offsets = chunks.map(({ sample, position, underrun }) => position + underrun - sample / MICROPHONE_RATE);
  const spread = quantile(offsets, 0.9) - quantile(offsets, 0.1);
  const sent = chunks.map(({ sample, at }) => at / 1000 - sample / MICROPHONE_RATE);
  const late = quantile(sent, 0.9) - quantile(sent, 0.1);
  console.log(`position against sample: ${ms(spread)} apart in ${chunks.length} chunks, which were sent ${ms(late)} apart`);
  expect(late).toBeGreaterThan(FORGIVEN); // else the page was not busy
  expect(spread).toBeLessThan(FORGIVEN);
});

/** What was recorded while the long answer was heard. */
function answer(microphone: Heard[]): Heard[] {
  return microphone.filter(({ playing, position }) => playing !== null && position > 0);
}

function seconds(chunks: Heard[]): number {
  return chunks.length < 2 ? 0 : (chunks.at(-1)!.sample - chunks[0]!.sample) / MICROPHONE_RATE;
}
