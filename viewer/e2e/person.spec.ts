import type { Page } from 'playwright-core';
import { afterAll, beforeAll, beforeEach, describe, expect, test } from 'vitest';
import { Browser } from '../support/browser/browser.ts';
import { drawSeldom, refreshed, stillPerson } from '../support/browser/drawing.ts';
import { feed, noise } from '../support/sound/feeder.ts';
import { atRest, excess, headAt, makePerson, readSteps, settle, watchSteps } from '../support/references/person.ts';
import { drawnBy, type Path } from '../support/browser/path.ts';
import { finished, openPage, SHORTER, until } from '../support/browser/talk.ts';
import { crop, lookAsBundled, psnr, takePixels } from '../support/browser/pictures.ts';
import { ChatServer } from '../support/servers/server.ts';
import { servePage } from '../support/servers/static.ts';

const WIDTH = 240;
const HEIGHT = 320;
const HEAD = { left: 114, top: 44, width: 40, height: 38 }; // pixels around the head at 0 s
const TIMES = [0, 1, 2.4];
const person = makePerson({ gaussians: '300,450', times: TIMES, pictures: `${WIDTH}x${HEIGHT}` });
const [start, end] = person.rest;
const pixels = 3 * WIDTH * HEIGHT;
const PLAN: [number, number][] = [[0, 0.8], [2, 1.6], [4, 2.6]];
const SPEECH = 100; // s: longer than any test

let server: Awaited<ReturnType<typeof servePage>>;
let browser: Browser;
let page: Page;

async function open(path: Path, calm = false): Promise<void> {
  browser = await Browser.launch({ width: WIDTH, height: HEIGHT, calm });
  page = await browser.open(drawnBy(path, server.url));
}

/** Gives the page an utterance of noise, and what the server would plan for its beginning. */
async function speak(utterance: number): Promise<void> {
  await page.evaluate(`window.noise = ${noise}`);
  await page.evaluate(([id, plan]) => window.ico3d!.director!.plan(id, plan), [utterance, PLAN] as const);
  await feed(page, utterance, SPEECH);
}

/** Waits until the person shows a time of its body. */
const shows = (time: number) =>
  page.waitForFunction((seconds) => Math.abs(window.ico3d!.body!.time - seconds) < 1e-6, time);

beforeAll(async () => (server = await servePage(person.folder)));
afterAll(() => server?.close());

describe('what WebGL draws of a whole person', () => {
  beforeAll(() => open('webgl'));
  afterAll(() => browser?.close());

  test('stands in the page as Python draws it, head and body sorted as one', async () => {
    expect(await page.locator('#player').isVisible()).toBe(false);
    expect(await page.locator('#composer').isVisible()).toBe(true);
    await lookAsBundled(page, person.folder);
    for (const [i, time] of TIMES.entries()) {
      await stillPerson(page, time);
      const seen = await takePixels(page);
      const right = person.pictures!.subarray(i * pixels, (i + 1) * pixels);
      console.log(`${time} s: ${psnr(seen, right).toFixed(1)} dB`);
      expect(psnr(seen, right)).toBeGreaterThan(40);
      if (i > 0) continue;
      const around = (picture: Uint8Array) => crop(picture, WIDTH, HEAD);
      const painted = person.painted!.subarray(0, pixels);
      const [asRight, asPainted] = [right, painted].map((picture) => psnr(around(seen), around(picture)));
      console.log(`head: ${asRight!.toFixed(1)} dB; ${asPainted!.toFixed(1)} dB if it were painted over the body`);
      expect(asRight).toBeGreaterThan(36);
      expect(asPainted).toBeLessThan(asRight! - 5);
    }
  });
});

describe('a whole person', () => {
  beforeAll(() => open('soft'));
  beforeEach(async () => {
    await page.reload();
    await page.waitForFunction(() => window.ico3d !== undefined);
  });
  afterAll(() => browser?.close());

  test('idles in its rest span, and the head follows the body', async () => {
    await watchSteps(page);
    await page.waitForFunction(() => window.steps!.length > 20 && window.steps!.at(-1)!.at > 4);
    const steps = await readSteps(page);
    const times = steps.map(({ time }) => time);
    expect(steps.every((step) => atRest(person, step))).toBe(true);
    expect(Math.max(...times) - Math.min(...times)).toBeGreaterThan(0.5 * (end - start));
    expect(excess(steps, person.fastest)).toBeLessThan(1e-9);
    for (const { time, head } of steps) {
      headAt(person, time).forEach((value, k) => expect(head[k]).toBeCloseTo(value, 3));
    }
    console.log(`${steps.length} pictures`);
  });

  test('gestures as planned while it speaks; silenced, it goes back from where it is', async () => {
    await page.waitForTimeout(500);
    await watchSteps(page);
    await speak(0);
    await shows(2.6); // and stays: more is not planned yet
    await page.evaluate(() => {
      const { director, conversation } = window.ico3d!;
      const { seconds } = conversation!.player.heard()!;
      director!.plan(0, [[seconds + 0.5, 2.6], [seconds + 1.5, 1.8]]);
    });
    await shows(1.8);
    expect(await page.evaluate(() => window.ico3d!.conversation!.bodyTime())).toBeCloseTo(1.8, 6);
    await page.evaluate(() => window.ico3d!.conversation!.interrupt());
    const steps = await settle(page, person);
    const spoken = steps.filter(({ heard }) => heard !== null);
    expect(Math.max(...steps.map(({ time }) => time))).toBeCloseTo(2.6, 6);
    expect(new Set(spoken.map(({ window }) => window))).toEqual(new Set([0, 1, 2]));
    expect(excess(steps, person.fastest)).toBeLessThan(1e-9);
    for (const { time, head } of steps) {
      headAt(person, time).forEach((value, k) => expect(head[k]).toBeCloseTo(value, 3));
    }
    const late = steps.filter(({ waiting }) => waiting).length;
    console.log(`${spoken.length} pictures while it spoke, ${steps.length - spoken.length} at rest; ${late} waited`);
  });

  test('is met face to face on a phone, and can be seen from all around', async () => {
    await page.setViewportSize({ width: 195, height: 422 });
    await page.waitForFunction(() => window.ico3d!.stage.painter.pixels[1] === 422);
    await refreshed(page);
    await drawSeldom(page); // the camera tells where the visitor looks from
    const eyes = await page.evaluate(async () => {
      const { stage, head } = window.ico3d!;
      await stage.still();
      window.draw!();
      return (1 - head!.generator.position.clone().project(stage.orbit.camera).y) / 2;
    });
    expect(eyes).toBeGreaterThan(0.2);
    expect(eyes).toBeLessThan(1 / 3);
    await page.evaluate(() => window.ico3d!.stage.start());
    await page.focus('#stage');
    for (let i = 0; i < 30; i++) await page.keyboard.press('ArrowLeft'); // 120 degrees
    expect(await page.evaluate(() => window.ico3d!.stage.orbit.camera.position.z)).toBeLessThan(-0.3);
  });
});

describe('a visitor who wants little motion', () => {
  beforeAll(() => open('soft', true));
  afterAll(() => browser?.close());

  test('sees the body stand where the rest ends, and the face talk', async () => {
    await page.waitForTimeout(300);
    await watchSteps(page);
    await speak(0);
    await page.waitForFunction(() => new Set(window.steps!.map(({ face }) => face)).size > 4);
    const steps = await readSteps(page);
    expect(new Set(steps.map(({ time }) => time))).toEqual(new Set([end]));
  });

  test('reads one sentence where the animation is damaged', async () => {
    await page.route('**/animation.json*', (route) => route.fulfill({ body: '{}' }));
    await page.reload();
    const sentence = page.locator('#overlay-error');
    await sentence.waitFor();
    expect(await sentence.textContent()).toBe('animation.json is shorter than manifest.json says.');
  });
});

describe('a whole person in a conversation', () => {
  let server: ChatServer;

  beforeAll(async () => {
    server = await ChatServer.start(person.file);
    browser = await openPage(server.url, { width: 128, height: 160 });
    page = browser.page;
  });

  afterAll(async () => {
    await browser?.close();
    await server?.stop();
  });

  test('gestures while it answers, along what the server plans, and returns to rest', async () => {
    await until(browser, finished(0)); // the greeting
    await watchSteps(page);
    await settle(page, person);
    await page.fill('#text', SHORTER);
    await page.keyboard.press('Enter');
    const { received } = await until(browser, finished(1));
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
