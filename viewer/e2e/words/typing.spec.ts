import { afterAll, beforeAll, expect, inject, test } from 'vitest';
import type { Browser } from '../../support/browser/browser.ts';
import { openPage } from '../../support/browser/talk.ts';

let browser: Browser;

beforeAll(async () => {
  browser = await openPage(inject('shared').talkingUrl, { width: 390, height: 844, calm: true });
});

afterAll(() => browser?.close());

test('the button to talk shows what is held while one speaks, not what stands for chats', async () => {
  const drawn = await browser.page.locator('#talk path').getAttribute('d');
  expect(drawn).not.toContain('l-4 4v-4'); // the tip of a speech bubble
  expect(drawn).toContain('V2.8'); // an aerial
});
