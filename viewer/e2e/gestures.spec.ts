import { afterAll, beforeAll, describe, expect, test } from 'vitest';
import type { Browser } from '../support/browser/browser.ts';
import { atRest, excess, headAt, makePerson, settle, watchSteps } from '../support/references/person.ts';
import { ChatServer } from '../support/servers/server.ts';
import { finished, openPage, SENTENCE, until } from '../support/browser/talk.ts';

const person = makePerson({ gaussians: '300,500' });

describe('a whole person in a conversation', () => {
  let server: ChatServer;
  let browser: Browser;

  beforeAll(async () => {
    server = await ChatServer.start(person.file);
    browser = await openPage(server.url, { width: 128, height: 160 });
  });

  afterAll(async () => {
    await browser?.close();
    await server?.stop();
  });

  test('gestures while it answers, along what the server plans, and returns to rest', async () => {
    const { page } = browser;
    await until(browser, finished(0), 60_000); // the greeting
    await watchSteps(page);
    await settle(page, person);
    await page.fill('#text', SENTENCE);
    await page.keyboard.press('Enter');
    const { received } = await until(browser, finished(1), 100_000);
    const steps = await settle(page, person);

    const plan = received.filter(({ type, utterance }) => type === 'timeline' && utterance === 1);
    const points = plan.flatMap((message) => message.points as [number, number][]);
    expect(points.length).toBeGreaterThan(5);
    expect(points.at(-1)![1]).toBeCloseTo(person.rest[1], 3);
    const spoken = steps.filter(({ heard }) => heard?.utterance === 1);
    const away = spoken.filter((step) => !atRest(person, step));
    expect(Math.max(...points.map(([, body]) => body))).toBeGreaterThan(person.rest[1] + 0.3);
    expect(Math.max(...spoken.map(({ time }) => time))).toBeGreaterThan(person.rest[1] + 0.3);
    expect(excess(steps, person.fastest)).toBeLessThan(1e-9);
    for (const { time, head } of steps) {
      headAt(person, time).forEach((value, k) => expect(head[k]).toBeCloseTo(value, 3));
    }
    console.log(`${spoken.length} pictures while it answers, ${away.length} of them away from rest`);
  });
});
