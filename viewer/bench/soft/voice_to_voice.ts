/**
 * Whether the packaged person answers as soon while her picture is drawn without WebGL as while it
 * stands still: by turns, question by question, in one page.
 */
import { existsSync } from 'node:fs';
import { join } from 'node:path';
import { expect, test } from 'vitest';
import { Browser } from '../../support/browser/browser.ts';
import { drawnBy } from '../../support/browser/path.ts';
import { pauseDrawing } from '../../support/browser/drawing.ts';
import { recordLoudness, recordWire } from '../../support/browser/recorder.ts';
import { until } from '../../support/browser/talk.ts';
import { turnsOf, type Turn } from '../../support/browser/turns.ts';
import { REPOSITORY, runPython } from '../../support/python.ts';
import { scratchFolder } from '../../support/scratch.ts';
import { ChatServer } from '../../support/servers/server.ts';
import { quantile } from '../../support/statistics.ts';

const DEMO = join(REPOSITORY, 'src/ico3d/chat/data/demo.ico3d');
const TURNS = 24;
const PAUSE = 4; // s for an answer, which is cut short once it sounds
const QUESTIONS = ['who are you', 'what is your name', 'where do you live', 'how old are you'];
const [WIDTH, HEIGHT] = [900, 700];
const MOST = 1.1; // of the time with the picture standing still
const PATIENCE = 40_000; // ms for an answer

test.skipIf(!existsSync(DEMO))(`voice to voice over ${TURNS} turns, drawing and not`, async () => {
  const voice = join(scratchFolder(), 'voice.wav');
  const parts = Array.from({ length: TURNS }, (_, i) => [QUESTIONS[(i >> 1) % QUESTIONS.length]!, String(PAUSE)]);
  runPython('sound/voice.py', voice, '8', ...parts.flat());
  const server = await ChatServer.start(DEMO);
  const browser = await Browser.launch({ width: WIDTH, height: HEIGHT, hertz: 60, microphone: voice });
  await recordWire(browser.context);
  const page = await browser.open(drawnBy('soft', server.url));
  await recordLoudness(page);
  await page.click('#microphone');
  const changes: { at: number; drawing: boolean }[] = [];
  let turns: Turn[] = [];
  for (let turn = 0; turn < TURNS; turn++) {
    const drawing = turn % 4 === 0 || turn % 4 === 3; // drawing and not, not and drawing: what changes slowly cancels
    if (drawing) await page.evaluate(() => window.ico3d!.stage.start());
    else await pauseDrawing(page);
    changes.push({ at: await page.evaluate(() => performance.now()), drawing });
    const answered = turns.length;
    const record = await until(browser, (now) => turnsOf(now).length > answered, PATIENCE).catch(() => null);
    if (!record) break; // a question was not heard, and no other one comes
    turns = turnsOf(record);
    await page.keyboard.press('Escape');
  }
  await browser.close();
  await server.stop();

  const half = (drawing: boolean) => turns.filter(({ asked }) => changes.findLast(({ at }) => at < asked)?.drawing === drawing);
  const times = (drawing: boolean, part = 'voice to voice') => half(drawing).map(({ parts }) => parts[part]!);
  const [drawn, still] = [times(true), times(false)];
  const ms = (list: number[], share: number) => quantile(list, share)?.toFixed(0);
  const row = (name: string, drawing: boolean) => {
    const middles = ['question’s end to speech message', 'speech message to sound'].map((part) => ms(times(drawing, part), 0.5));
    return `| ${[name, half(drawing).length, ...middles, ms(times(drawing), 0.5), ms(times(drawing), 0.95)].join(' | ')} |`;
  };
  console.log([row('standing still', false), row('drawn', true)].join('\n'));
  expect(Math.min(drawn.length, still.length)).toBeGreaterThan(TURNS / 3);
  expect(quantile(drawn, 0.5)).toBeLessThan(MOST * quantile(still, 0.5));
});
