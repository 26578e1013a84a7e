import type { Page } from 'playwright-core';
import { afterEach, beforeEach, describe, expect, inject, test } from 'vitest';
import { judge } from '../../support/browser/axe.ts';
import { Browser } from '../../support/browser/browser.ts';
import { pauseDrawing } from '../../support/browser/drawing.ts';
import { drawnBy } from '../../support/browser/path.ts';

const { talkingUrl } = inject('shared');
const QUESTION = 'tell me about yourself';
const LONG = 'we must find a new home in the stars'; // has a long answer

let browser: Browser;
let page: Page;
let errors: string[];
let hellos: { session: string | null }[];

beforeEach(async () => {
  browser = await Browser.launch({ width: 1280, height: 720, calm: true });
  ({ page } = browser);
  [errors, hellos] = [[], []];
  page.on('pageerror', (error) => errors.push(String(error)));
  await page.routeWebSocket(/\/ws/, (line) => {
    const server = line.connectToServer();
    line.onMessage((frame) => {
      if (typeof frame === 'string' && frame.startsWith('{"type":"hello"')) hellos.push(JSON.parse(frame) as (typeof hellos)[0]);
      server.send(frame);
    });
  });
});
afterEach(() => browser?.close());

/** Opens the page, and waits until the greeting was heard. */
async function visit(): Promise<void> {
  await browser.open(drawnBy('soft', talkingUrl));
  await greeted();
}

/** The same after a reload. */
async function reload(): Promise<void> {
  await page.reload();
  await page.waitForFunction(() => window.ico3d !== undefined);
  await greeted();
}

async function greeted(): Promise<void> {
  await pauseDrawing(page);
  await page.waitForFunction(() => document.querySelector('#answer')!.textContent === 'Hello.' && document.body.dataset.state === 'idle');
}

async function ask(question: string): Promise<void> {
  await page.fill('#text', question);
  await page.press('#text', 'Enter');
}

const rows = () => page.locator('#record > div').allTextContents();
const dividers = () => page.locator('#record > .divider').allTextContents();
const kept = () => page.evaluate(() => Object.entries(sessionStorage).filter(([key]) => key.startsWith('ico3d-talk')));
const keep = (value: string) =>
  page.evaluate(([key, value]) => sessionStorage.setItem(key!, value!), [`ico3d-talk-${talkingUrl}`, value]);

describe('after a reload', () => {
  test('what was said is there as an earlier talk, which the avatar does not know, and can be cleared', async () => {
    await visit();
    await ask(QUESTION);
    await page.waitForFunction(() => document.querySelectorAll('#record > div').length === 3 && document.body.dataset.state === 'idle');
    const before = await rows();
    expect(before[1]).toMatch(new RegExp(`^You .*${QUESTION}$`));
    await expect.poll(async () => (await kept()).join()).toContain(before[2]!.slice(-20)); // also if the browser ends the page without a word

    await reload();
    expect(hellos.map(({ session }) => session)).toEqual([null, null]); // the session of before ended with its page
    expect((await rows()).slice(0, 3)).toEqual(before);
    expect(await rows()).toHaveLength(4); // the new greeting
    expect(await dividers()).toEqual(['Earlier: Stella no longer knows this', expect.stringMatching(/^A new conversation · \d/)]);
    expect(await page.locator('#announcer p').allTextContents()).toEqual(['Stella: Hello.']); // nothing is told twice
    await page.click('#drawer-button');
    expect(await page.textContent('#drawer-kept')).toBe('Kept in this tab until it is closed.');
    await judge(page, 'the transcript after a reload');
    await page.setViewportSize({ width: 1280, height: 720 });
    const [download] = await Promise.all([page.waitForEvent('download'), page.click('#drawer-save')]);
    expect(download.suggestedFilename()).toMatch(/^Stella/);

    await reload();
    expect((await rows()).slice(0, 3)).toEqual(before);
    expect(await rows()).toHaveLength(4); // talks without a question do not pile up
    await page.click('#drawer-button');
    await page.click('#drawer-clear');
    expect([await rows(), await dividers(), await kept()]).toEqual([[], [], []]);
    expect([await page.textContent('#record'), await page.textContent('#drawer-told')]).toEqual(['Nothing here yet.', 'Cleared here; Stella still knows it']);
    expect(await page.isHidden('#captions')).toBe(true);
    expect(await page.getAttribute('#drawer-clear', 'title')).toMatch(/^Clears what this page shows .* Stella still knows this talk until it ends$/);
    await reload();
    expect([(await rows()).length, await dividers()]).toEqual([1, []]);
    expect(errors).toEqual([]);
  });

  test('in the midst of an answer, it ends where the answer was cut off', async () => {
    await visit();
    await ask(LONG);
    await page.waitForFunction(() => /very far/.test(document.querySelector('#answer span')!.textContent!));
    await reload();
    const [, question, answer] = await rows();
    expect(question).toContain(LONG);
    expect(answer).toMatch(/The stars are very far.* …$/);
    expect(answer).not.toMatch(/children/);
  });

  test('nobody reads it under another name, nor in another tab', async () => {
    await visit();
    await ask(QUESTION);
    await page.waitForFunction(() => document.querySelectorAll('#record > div').length === 3);
    const other = await browser.context.newPage();
    await other.goto(drawnBy('soft', talkingUrl));
    await other.waitForFunction(() => document.querySelectorAll('#record > div').length === 1);
    expect(await other.locator('#record').textContent()).not.toContain(QUESTION);
    await other.close();

    await page.route('**/bundle/manifest.json*', async (route) => {
      const manifest = (await (await route.fetch()).json()) as { persona: { name: string } };
      await route.fulfill({ json: { ...manifest, persona: { ...manifest.persona, name: 'Ada' } } });
    });
    await visit();
    expect(await page.textContent('#name')).toBe('Ada');
    expect(await rows()).toEqual([expect.stringMatching(/^Ada .*Hello\.$/)]);
    expect(await dividers()).toEqual([]);
  });

  test('what is no talk is none, and no markup either', async () => {
    await visit();
    await ask('<img src=x onerror=alert(1)>');
    await page.waitForFunction(() => document.querySelectorAll('#record > div').length >= 2);
    await visit();
    expect((await rows())[1]).toContain('<img src=x onerror=alert(1)>');
    expect(await page.locator('#record img').count()).toBe(0);
    const [, whole] = (await kept())[0]!;
    await page.evaluate(() => window.ico3d!.visit.dispose()); // this page writes nothing over it
    await keep(whole.slice(0, -1)); // other damage: `kept-talk.test.ts`
    await visit();
    expect([(await rows()).length, await dividers()]).toEqual([1, []]);
    expect(errors).toEqual([]);
  });
});
