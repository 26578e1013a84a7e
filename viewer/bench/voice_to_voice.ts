/**
 * How long the avatar takes to answer, measured in the page: from the last loud chunk of the
 * microphone to the first sound that the player puts out, over 20 spoken questions.
 */
import { join } from 'node:path';
import { expect, test } from 'vitest';
import { Browser } from '../support/browser/browser.ts';
import { pauseDrawing } from '../support/browser/drawing.ts';
import { runPython } from '../support/python.ts';
import { readRecord, recordLoudness, recordWire } from '../support/browser/recorder.ts';
import { scratchFolder } from '../support/scratch.ts';
import { ChatServer } from '../support/servers/server.ts';
import { quantile } from '../support/statistics.ts';
import { turnsOf, type Turn } from '../support/browser/turns.ts';

const TURNS = 20;
const PAUSE = 9; // s for the answer
const QUESTIONS = ['who are you', 'what is your name', 'where do you live', 'how old are you'];

test(`voice to voice over ${TURNS} turns`, async () => {
  const folder = scratchFolder();
  const [bundle, voice] = [join(folder, 'random.ico3d'), join(folder, 'voice.wav')];
  runPython('../../tests/support/bundles/random_bundle.py', bundle, '--gaussians', '300');
  const parts = Array.from({ length: TURNS }, (_, i) => [QUESTIONS[i % QUESTIONS.length]!, String(PAUSE)]);
  runPython('sound/voice.py', voice, '6', ...parts.flat());

  const server = await ChatServer.start(bundle);
  const browser = await Browser.launch({ width: 320, height: 240, microphone: voice });
  await recordWire(browser.context);
  await browser.open(server.url);
  await recordLoudness(browser.page);
  await pauseDrawing(browser.page);
  await browser.page.click('#microphone');
  await browser.page.waitForTimeout(1000 * (8 + TURNS * (PAUSE + 1.2)));
  const turns = turnsOf(await readRecord(browser.page)).map(({ parts }) => parts);
  await browser.close();
  await server.stop();

  print(turns);
  expect(turns.length).toBeGreaterThan(0.8 * TURNS);
});

function print(turns: Turn['parts'][]): void {
  const parts = [...new Set(turns.flatMap(Object.keys))];
  const rows = parts.map((part) => {
    const values = turns.map((turn) => turn[part]!).filter(Number.isFinite);
    return { part, turns: values.length, 'p50 ms': Math.round(quantile(values, 0.5)), 'p95 ms': Math.round(quantile(values, 0.95)) };
  });
  console.table(rows);
}
