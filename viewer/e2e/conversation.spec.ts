import { join } from 'node:path';
import { afterAll, beforeAll, describe, expect, inject, test } from 'vitest';
import type { Browser } from '../support/browser/browser.ts';
import { readRecord, type Record } from '../support/browser/recorder.ts';
import { runPython } from '../support/python.ts';
import { scratchFolder } from '../support/scratch.ts';
import { slowness } from '../support/slowness.ts';
import { finished, openPage, SENTENCE, SHORTER, SILENCE, until } from '../support/browser/talk.ts';

const { talkingUrl } = inject('shared');

describe('a typed question', () => {
  let browser: Browser;
  beforeAll(async () => (browser = await openPage(talkingUrl)));
  afterAll(() => browser?.close());

  test('is answered with words, sound and a moving face', async () => {
    const { page } = browser;
    await until(browser, finished(0)); // the greeting
    expect(await page.locator('#answer').textContent()).toBe('Hello.');
    expect(await page.locator('#stand-ins').textContent()).toBe(
      'Basic offline services listen, answer, and speak; better ones are in the settings',
    );

    await page.evaluate(() => {
      const { head, conversation } = window.ico3d!;
      const faces: { at: number; speaking: boolean; expression: number[] }[] = [];
      Object.assign(window, { faces });
      setInterval(() => {
        const speaking = (conversation!.player.heard()?.seconds ?? -1) > 0.2;
        faces.push({ at: performance.now(), speaking, expression: [...head!.expression] });
      }, 33);
    });
    await page.fill('#text', 'Who are you?');
    await page.keyboard.press('Enter');
    const record = await until(browser, finished(1));
    expect(await page.locator('#question').textContent()).toBe('Who are you?');
    expect(await page.locator('#answer').textContent()).toBe('I am Stella.');
    expect(Math.max(...record.loudness.map(({ level }) => level))).toBeGreaterThan(0.01);
    await page.click('#panel-button');
    const rows = await page.locator('#latencies tbody tr').allTextContents();
    expect(rows).toHaveLength(8); // seven parts, and when it was heard
    expect(rows.at(-1)).toMatch(/^heard[1-9]\d*$/);
    await page.click('#panel-button');

    type Face = { speaking: boolean; expression: number[] };
    const faces = () => page.evaluate(() => (window as unknown as { faces: Face[] }).faces);
    const spread = (rows: Face[]) => {
      const first = rows.map(({ expression }) => expression[0]!);
      return Math.max(...first) - Math.min(...first);
    };
    expect(spread((await faces()).filter(({ speaking }) => speaking))).toBeGreaterThan(0.01);
    await expect.poll(async () => spread((await faces()).slice(-8))).toBeLessThan(1e-6); // at rest again
  });

  test('falls silent while somebody may be speaking, and goes on where it stopped', async () => {
    const { page } = browser;
    await page.fill('#text', SENTENCE);
    await page.keyboard.press('Enter');
    const heard = ({ loudness }: { loudness: { level: number }[] }) =>
      loudness.slice(-20).every(({ level }) => level > SILENCE);
    await until(browser, heard);
    const [pause, resume] = (['pause', 'resume'] as const).map((what) => () => page.evaluate((what) => {
      const { player } = window.ico3d!.conversation!;
      player[what](player.current!);
      return { at: performance.now(), seconds: player.heard()!.seconds };
    }, what));
    const before = await pause!();
    await page.waitForTimeout(1500);
    const after = await resume!();
    expect(after.seconds - before.seconds).toBeLessThan(0.4); // what was on its way to the ear, no more
    const { loudness } = await until(browser, heard);
    const meanwhile = loudness.filter(({ at }) => at > before.at + 250 && at < after.at);
    expect(meanwhile.length).toBeGreaterThan(10);
    expect(Math.max(...meanwhile.map(({ level }) => level))).toBeLessThan(SILENCE);
    await page.keyboard.press('Escape');
  });

  test('can be cut short with Escape', async () => {
    const { page } = browser;
    await page.fill('#text', SENTENCE);
    await page.keyboard.press('Enter');
    const speaks = ({ received, loudness }: Record) =>
      received.some((m) => m.type === 'speech' && m.utterance === 3) && loudness.slice(-20).every(({ level }) => level > SILENCE);
    await until(browser, speaks); // this answer, not what is left of the one before
    await page.evaluate(() => addEventListener('keydown', ({ timeStamp }) => Object.assign(window, { timeStamp })));
    await page.keyboard.press('Escape');
    await page.waitForTimeout(1500);
    const pressed = await page.evaluate(() => (window as unknown as { timeStamp: number }).timeStamp);
    const { loudness } = await readRecord(page);
    const last = loudness.findLast(({ level }) => level > SILENCE)!;
    expect(last.at - pressed).toBeLessThan(250 * slowness()); // fade and the analyser's window
  });

  test('after a dropped connection the same session goes on', async () => {
    const { page } = browser;
    await page.fill('#text', SHORTER);
    await page.keyboard.press('Enter');
    await until(browser, ({ received }) => received.some((m) => m.type === 'speech' && m.utterance === 4));
    await page.evaluate(() => window.record!.sockets.at(-1)!.close());
    await until(browser, ({ received }) => received.filter(({ type }) => type === 'welcome').length === 2);
    const record = await until(browser, finished(4));
    const [first, second] = record.received.filter(({ type }) => type === 'welcome');
    const last = record.received.findLast(({ type }) => type === 'speech');
    expect(last!.at).toBeGreaterThan(second!.at); // there was something left to say
    expect(second).toMatchObject({ resumed: true, session: first!.session });
    const pieces = record.received.filter(({ type, utterance }) => type === 'speech' && utterance === 4);
    const indices = new Set(pieces.map(({ index }) => index as number)); // they are counted from the greeting on
    expect(indices.size).toBe(Math.max(...indices) - Math.min(...indices) + 1); // none is missing
  });

  test('without a microphone the page says so and typing goes on', async () => {
    await browser.context.clearPermissions();
    await browser.page.click('#microphone');
    await expect.poll(() => browser.page.textContent('#notices')).toMatch(/microphone .* type instead\.$|type instead\.$/);
    expect(await browser.page.getAttribute('#microphone', 'aria-pressed')).toBe('false');
  });
});

test('while the microphone is open the page says that the visitor may speak', async () => {
  const silence = join(scratchFolder(), 'silence.wav');
  runPython('sound/voice.py', silence, '30');
  const browser = await openPage(talkingUrl, { microphone: silence });
  const { page } = browser;
  const says = (text: string) => page.waitForFunction((text) => document.getElementById('state')!.textContent === text, text);
  await until(browser, finished(0));
  await says('Ready');
  await page.click('#microphone');
  await says('Speak or type');
  await page.click('#microphone');
  await says('Ready');
  await browser.close();
});
