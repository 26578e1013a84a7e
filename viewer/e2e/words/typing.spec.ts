import { afterAll, beforeAll, expect, inject, test } from 'vitest';
import type { Browser } from '../../support/browser/browser.ts';
import { openPage } from '../../support/browser/talk.ts';

const FINGER = 44; // pixels

let browser: Browser;

beforeAll(async () => {
  browser = await openPage(inject('shared').talkingUrl, { width: 390, height: 844, calm: true });
});

afterAll(() => browser?.close());

/** The parts of the bar in which one types that are seen, and where its text box is. */
async function bar() {
  const { page } = browser;
  const shown = await page.locator('#composer > :visible').evaluateAll((parts) => parts.map(({ id }) => id));
  const { x, width } = (await page.locator('#text').boundingBox())!;
  return { shown, x, width };
}

test('on a narrow screen the buttons that typing does without make room for it', async () => {
  const { page } = browser;
  const all = ['microphone', 'mute', 'talk', 'text'];
  expect((await bar()).shown).toEqual(all); // although the text box has the focus from the beginning
  await page.click('#text');
  const touched = await bar();
  expect(touched.shown).toEqual(['microphone', 'text']);
  await page.keyboard.type('What can you do?');
  const typed = await bar();
  expect(typed.shown).toEqual(['microphone', 'text', 'send']);
  expect(typed.x).toBe(touched.x); // nothing jumps under the first letter
  expect(typed.width).toBeGreaterThan(220);
  expect(await page.locator('#text').evaluate((text) => text.scrollWidth - text.clientWidth)).toBe(0);
  for (const id of ['microphone', 'send']) {
    const { width, height } = (await page.locator(`#${id}`).boundingBox())!;
    expect(Math.min(width, height)).toBeGreaterThanOrEqual(FINGER);
  }
  await page.focus('#stage');
  expect((await bar()).shown).toEqual(['microphone', 'text', 'send']); // what was typed is still there
  await page.fill('#text', '');
  await page.focus('#stage');
  expect((await bar()).shown).toEqual(all);
});

test('on a wide screen all of them stay', async () => {
  const { page } = browser;
  await page.setViewportSize({ width: 1280, height: 720 });
  await page.click('#text');
  await page.keyboard.type('Hello');
  expect((await bar()).shown).toEqual(['microphone', 'mute', 'talk', 'text', 'send']);
});

test('the browser knows what it may propose to who does not know what to ask', async () => {
  // The list itself is drawn by the browser, outside of the page, and not at all without a screen.
  const proposed = await browser.page.locator('#text').evaluate((text) => [...(text as HTMLInputElement).list!.options].map(({ value }) => value));
  expect(proposed).toEqual(['We must find a new home in the stars', 'Tell me about yourself', 'Who are you']);
});

test('the button to talk shows what is held while one speaks, not what stands for chats', async () => {
  const drawn = await browser.page.locator('#talk path').getAttribute('d');
  expect(drawn).not.toContain('l-4 4v-4'); // the tip of a speech bubble
  expect(drawn).toContain('V2.8'); // an aerial
});
