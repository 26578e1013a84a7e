import { readFileSync } from 'node:fs';
import { afterAll, beforeAll, describe, expect, inject, test } from 'vitest';
import type { Browser } from '../../support/browser/browser.ts';
import { pauseDrawing } from '../../support/browser/drawing.ts';
import { finished, keepCaptions, openPage, SENTENCE, SHORTER, until } from '../../support/browser/talk.ts';
import { slowness } from '../../support/slowness.ts';

const { talkingUrl } = inject('shared');
const LATE = 0.15; // s that a caption may be behind the sound, on a machine that is not busy

/** What captions and screen readers show at a moment of the sound. */
interface Sight {
  seconds: number;
  sentence: string;
  heard: string;
  announced: string;
}

/** A message with the times of words, as `record` holds it. */
interface Spoken {
  type: string;
  utterance: number;
  first_sample: number;
  starts: number[];
  times: number[];
}

let browser: Browser;
beforeAll(async () => {
  browser = await openPage(talkingUrl, { width: 1280, height: 720, calm: true });
  await pauseDrawing(browser.page);
  await browser.context.grantPermissions(['clipboard-read', 'clipboard-write']);
  await until(browser, finished(0)); // the greeting
  await keepCaptions(browser.page);
});
afterAll(() => browser?.close());

/** Whether the greeting of the newest conversation has been said and heard. */
function greeted(received: { type: string; state?: string }[]): boolean {
  const since = received.slice(received.findLastIndex(({ type }) => type === 'welcome'));
  return since.some(({ type }) => type === 'end') && since.findLast(({ type }) => type === 'state')?.state === 'idle';
}

const record = () => browser.page.locator('#record > div').allTextContents();
const announced = () => browser.page.locator('#announcer p').allTextContents();

async function ask(question: string): Promise<void> {
  await browser.page.fill('#text', question);
  await browser.page.press('#text', 'Enter');
}

describe('an answer', () => {
  test('is shown word by word as it is heard, and told to screen readers once, after the voice', async () => {
    const { page } = browser;
    await page.waitForFunction(() => document.getElementById('announcer')!.textContent === 'Stella: Hello.');
    await page.evaluate(() => {
      const sights: Sight[] = [];
      Object.assign(window, { sights });
      setInterval(() => {
        const at = window.ico3d!.conversation!.player.heard();
        if (at?.utterance !== 1) return;
        const answer = document.getElementById('answer')!;
        const [heard, sentence] = [answer.firstElementChild!.textContent!, answer.textContent!];
        sights.push({ seconds: at.seconds, sentence, heard, announced: document.getElementById('announcer')!.textContent! });
      }, 20);
    });
    await ask(SHORTER);
    const { received } = await until(browser, finished(1));
    const sights = (await page.evaluate(() => (window as unknown as { sights: Sight[] }).sights)) as Sight[];
    const spoken = (received as unknown as Spoken[]).filter(({ type, utterance }) => type === 'spoken' && utterance === 1);
    expect(spoken.length).toBeGreaterThanOrEqual(2); // sentences
    const late = LATE * slowness();
    const begun = (times: number[], at: number) => times.filter((time) => time <= at).length;
    let judged = 0;
    for (const { starts, times } of spoken) {
      expect(starts.length).toBeGreaterThan(3);
      const of = sights.filter(({ seconds, sentence }) => seconds > times[0]! && seconds < times.at(-1)! && sentence.split(' ').length === starts.length);
      for (const { seconds, heard } of of) {
        judged++;
        const words = heard.trim().split(' ').filter(Boolean).length;
        expect(words).toBeLessThanOrEqual(begun(times, seconds));
        expect(words).toBeGreaterThanOrEqual(begun(times, seconds - late));
      }
    }
    expect(judged).toBeGreaterThan(50);
    expect(sights.filter(({ heard, sentence }) => heard !== '' && heard !== sentence).length).toBeGreaterThan(10);
    expect(sights.every(({ announced }) => announced === 'Stella: Hello.')).toBe(true); // nothing is said over the voice
    const answer = 'I am a small avatar that was made for tests. My head is a few hundred Gaussians, and they move with every word that I say.';
    await page.waitForFunction(() => document.querySelectorAll('#announcer p').length === 2);
    expect(await announced()).toEqual([`You: ${SHORTER}`, `Stella: ${answer}`]);
    expect(await page.getAttribute('#captions', 'aria-hidden')).toBe('true');
    expect(await page.textContent('#answer')).toBe(answer); // the last sentence alone would often be no answer
    expect(await record()).toEqual([
      expect.stringMatching(/^Stella .*Hello\.$/),
      expect.stringMatching(new RegExp(`^You .*${SHORTER}$`)),
      expect.stringContaining(answer),
    ]);
  });

  test('that is interrupted is kept as far as it was heard', async () => {
    const { page } = browser;
    await ask(SENTENCE);
    await page.waitForFunction(() => /very far/.test(document.querySelector('#answer span')!.textContent!));
    await page.keyboard.press('Escape');
    await page.waitForFunction(() => document.querySelector('#record > div:last-of-type')!.textContent!.endsWith(' …'));
    const last = (await record()).at(-1)!;
    expect(last).toMatch(/The stars are very far/);
    expect(last).not.toMatch(/children/);
    expect(await page.textContent('#answer .unheard')).toBe('');
    expect(last.endsWith((await page.textContent('#answer'))!)).toBe(true);
  });

  test('is read to its end when a phone is turned', async () => {
    const { page } = browser;
    const before = await page.textContent('#answer');
    const atEnd = () => page.evaluate(() => {
      const { scrollTop, clientHeight, scrollHeight } = document.getElementById('answer')!;
      return { more: scrollHeight > clientHeight + 1, left: Math.round(scrollHeight - clientHeight - scrollTop) };
    });
    await page.evaluate(() => (document.querySelector('#answer span')!.textContent = 'Words that fill lines, and more of them. '.repeat(8)));
    await page.setViewportSize({ width: 844, height: 390 });
    await expect.poll(atEnd).toEqual({ more: true, left: 0 });
    const mark = await page.locator('#cut').evaluate((cut) => {
      const [sign, answer, captions] = [cut, cut.nextElementSibling!, cut.parentElement!].map((element) => element.getBoundingClientRect());
      return { text: cut.textContent, above: answer!.top - sign!.top, shown: cut.getClientRects().length, inside: sign!.left >= captions!.left };
    });
    expect(mark).toEqual({ text: '…', above: 0, shown: 1, inside: true }); // before the first line that is seen
    await page.evaluate((text) => (document.querySelector('#answer span')!.textContent = text), before);
    await page.setViewportSize({ width: 1280, height: 720 });
    await page.waitForSelector('#cut', { state: 'hidden' });
  });

  test.each([
    [1280, 800, 'large'],
    [844, 390, ''],
    [390, 844, ''],
  ])('of some sentences is seen from its first word on in %i × %i (%s)', async (width, height, size) => {
    const { page } = browser;
    const before = await page.textContent('#answer');
    await page.evaluate((size) => {
      document.documentElement.dataset.captionsSize = size;
      document.querySelector('#answer span')!.textContent = 'I do not know that. You can ask me, for example: “who are you”, or “are you real”, or “what is ico3d”.';
    }, size);
    await page.setViewportSize({ width, height });
    const hidden = await page.locator('#answer').evaluate(({ clientHeight, scrollHeight }) => scrollHeight - clientHeight);
    await page.evaluate((text) => {
      delete document.documentElement.dataset.captionsSize;
      document.querySelector('#answer span')!.textContent = text;
    }, before);
    await page.setViewportSize({ width: 1280, height: 720 });
    expect(hidden).toBeLessThanOrEqual(1);
  });

  test.each(['', 'small', 'large'])('shows whole lines, the last one among them (%s)', async (size) => {
    const { page } = browser;
    const shown = await page.evaluate((size) => {
      document.documentElement.dataset.captionsSize = size;
      const answer = document.getElementById('answer')!;
      const [heard, next] = answer.children;
      const before = heard!.textContent;
      heard!.textContent = 'Words that fill a line, and then another one, and more of them. '.repeat(30);
      const { clientHeight, scrollHeight } = answer;
      answer.scrollTop = scrollHeight;
      const line = parseFloat(getComputedStyle(answer).lineHeight);
      heard!.textContent = before;
      delete document.documentElement.dataset.captionsSize;
      return { lines: clientHeight / line, more: scrollHeight > clientHeight, next: next!.textContent };
    }, size);
    expect(shown).toMatchObject({ more: true, next: '' });
    expect(Math.abs(shown.lines - Math.round(shown.lines))).toBeLessThan(0.05);
    expect(shown.lines).toBeGreaterThan(3.9);
  });

  test.each(['mouse', 'keyboard'])('that is stopped with the button (%s) leaves the focus in the text box', async (by) => {
    const { page } = browser;
    await ask(SENTENCE);
    await page.waitForSelector('#stop:not(.gone)');
    if (by === 'mouse') await page.click('#stop');
    else await page.press('#stop', 'Enter');
    await page.waitForSelector('#stop.gone', { state: 'attached' });
    expect(await page.evaluate(() => document.activeElement!.id)).toBe('text');
  });
});

test('who clicks the button to talk is told that it is held', async () => {
  const { page } = browser;
  await page.click('#talk');
  await page.waitForFunction(() => [...document.querySelectorAll('#notices p')].some(({ textContent }) => textContent === 'Hold to talk'));
});

test('on a phone she comes back to where there is room again, once captions have been short for some seconds', async () => {
  const { page } = browser;
  await page.setViewportSize({ width: 390, height: 844 });
  const covered = () => page.evaluate(() => (window.ico3d!.stage as unknown as { covered: { all: number } }).covered.all);
  const ask = (text: string) => page.evaluate((text) => void (document.getElementById('question')!.textContent = text), text);
  await ask('');
  await page.waitForTimeout(1500); // all finds its place
  const few = await covered();
  await ask('a long question '.repeat(40));
  await page.waitForFunction((few) => (window.ico3d!.stage as unknown as { covered: { all: number } }).covered.all > few + 150, few);
  await ask('');
  await page.waitForTimeout(1000);
  expect(await covered()).toBeGreaterThan(few + 150); // the picture does not jump
  await page.waitForFunction((few) => (window.ico3d!.stage as unknown as { covered: { all: number } }).covered.all < few + 20, few);
  await page.setViewportSize({ width: 1280, height: 720 });
});

describe('the drawer', () => {
  test('opens with its key beside the picture, is copied and saved, and a keyboard closes it', async () => {
    const { page } = browser;
    await page.focus('#stage');
    await page.keyboard.press('t');
    expect(await page.evaluate(() => document.activeElement!.id)).toBe('record');
    const [drawer, stage] = await Promise.all(['#drawer', '#stage'].map((id) => page.locator(id).boundingBox()));
    expect(stage!.x + stage!.width).toBeLessThanOrEqual(drawer!.x + 1);
    await page.click('#drawer-copy');
    await page.waitForFunction(() => document.getElementById('drawer-told')!.textContent === 'Copied');
    const copied = await page.evaluate(() => navigator.clipboard.readText());
    const [download] = await Promise.all([page.waitForEvent('download'), page.click('#drawer-save')]);
    expect(readFileSync(await download.path(), 'utf8')).toBe(copied);
    expect(download.suggestedFilename()).toMatch(/^Stella conversation \d{4}-\d\d-\d\d\.txt$/);
    expect(copied).toMatch(/^Stella, .*\n\n\[[\d:]+ [AP]M\] Stella: Hello\.\n\[.*\] You: tell me about yourself\n/s);
    await page.focus('#record');
    await page.keyboard.press('Escape');
    expect([await page.isHidden('#drawer'), await page.evaluate(() => document.activeElement!.id)]).toEqual([true, 'drawer-button']);
    await page.focus('#text');
    await page.keyboard.type('t'); // a letter like others
    expect([await page.isHidden('#drawer'), await page.inputValue('#text')]).toEqual([true, 't']);
    await page.fill('#text', '');
  });

  test('keeps the talk through a lost connection, and as an earlier one when a new session begins', async () => {
    const { page } = browser;
    const before = await record();
    await page.evaluate(() => window.record!.sockets.at(-1)!.close());
    await until(browser, ({ received }) => received.filter(({ type }) => type === 'welcome').length === 2);
    expect(await record()).toEqual(before);
    await page.evaluate(() => window.ico3d!.conversation!.choose({ kind: 'language', key: 'persona-notes', name: '', hindrance: '' }));
    await page.waitForFunction((count) => document.querySelectorAll('#record > div').length === count + 1, before.length); // the new greeting
    expect((await record()).slice(0, -1)).toEqual(before);
    expect(await page.locator('#record .divider').allTextContents()).toEqual(['Earlier: Stella no longer knows this', expect.stringMatching(/^A new conversation · /)]);
    expect(await page.locator('#record > *').evaluateAll((rows) => rows.flatMap((row, at) => (row.matches('.divider') ? [at] : [])))).toEqual([0, before.length + 1]);
  });
});

test('the visitor chooses language and captions, which are remembered; all of it by keyboard', async () => {
  const { page } = browser;
  await page.focus('#settings-button');
  await page.keyboard.press('Enter');
  await page.keyboard.press('Tab'); // to the help
  await page.keyboard.press('Tab'); // to its ✕
  await page.keyboard.press('Tab');
  expect(await page.evaluate(() => document.activeElement!.id)).toBe('language');
  await page.keyboard.type('Deu');
  expect(await page.evaluate(() => document.documentElement.lang)).toBe('de');
  expect(await page.textContent('#state')).toMatch(/^(Bereit|Spricht)$/);
  expect(await page.getAttribute('#text', 'placeholder')).toBe('Fragen Sie etwas');
  expect(await page.getAttribute('.views button', 'title')).toBe('Gesicht (1)');
  expect(await page.textContent('#stand-ins')).toBe(
    'Kleine Offline-Dienste hören zu, antworten und sprechen; bessere in den Einstellungen',
  );
  expect(await page.locator('#record .divider').last().textContent()).toMatch(/^Ein neues Gespräch/);
  expect(await page.getAttribute('#captions', 'lang')).toBe(''); // nobody told which one she speaks
  await page.keyboard.press('Tab');
  await page.keyboard.press('Space');
  expect(await page.isHidden('#captions')).toBe(true);
  await page.keyboard.press('Space');
  const sized = () => page.evaluate(() => parseFloat(getComputedStyle(document.getElementById('answer')!).fontSize));
  const normal = await sized();
  await page.keyboard.press('Tab');
  await page.keyboard.press('ArrowDown');
  expect(await sized()).toBeGreaterThan(1.3 * normal);
  const kept = await page.evaluate(() => ({ ...localStorage }));
  expect(kept).toMatchObject({ 'ico3d-language': 'de', 'ico3d-captions-shown': 'on', 'ico3d-captions-size': 'large' });
  await page.keyboard.press('Escape');
  await until(browser, ({ received }) => greeted(received)); // the focus goes from "Stop" to the text box when the greeting ends
  const reached = new Set<string>();
  await page.focus('#stage');
  for (let i = 0; i < 30 && !reached.has('send'); i++) {
    await page.keyboard.press('Tab');
    reached.add(await page.evaluate(() => document.activeElement!.id));
  }
  expect([...reached]).toEqual(expect.arrayContaining(['panel-button', 'settings-button', 'drawer-button', 'microphone', 'talk', 'text', 'send']));
});
