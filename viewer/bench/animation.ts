/**
 * What animation costs: frames of a whole person who speaks and gestures, against frames of the
 * same splats that stand still behind an identity modifier and are updated each tick as well.
 */
import { createServer } from 'vite';
import { expect, test } from 'vitest';
import { Browser } from '../support/browser.ts';
import { makePerson } from '../support/person.ts';
import { REPOSITORY } from '../support/python.ts';
import { ChatServer } from '../support/server.ts';
import { quantile } from '../support/statistics.ts';
import type { Frame } from './page/scenes.ts';

const GAUSSIANS = '3500,2500'; // on the head, on the body
const [WIDTH, HEIGHT] = [480, 640];
const BLOCKS = 4; // of either scene, in turns: a busy machine slows both
const FRAMES = 60; // in a block
const MOST_COST = 1.25; // of the still scene
const LONGEST = 3; // of the median

test('an animated person against the same splats at rest', async () => {
  const chat = await ChatServer.start(makePerson({ gaussians: GAUSSIANS }).file);
  const proxy = { '/bundle': chat.url, '/ws': { target: chat.url, ws: true } };
  const pages = await createServer({ root: `${REPOSITORY}viewer`, logLevel: 'error', server: { port: 0, host: '127.0.0.1', proxy } });
  await pages.listen();
  const browser = await Browser.launch({ width: WIDTH, height: HEIGHT });
  const { page } = browser;
  await browser.open(pages.resolvedUrls!.local[0]!);
  await page.evaluate(() => window.ico3d!.stage.still());
  await page.addScriptTag({ type: 'module', url: '/bench/page/scenes.ts' });
  await page.waitForFunction(() => window.scenes !== undefined);
  const [animated, still]: [Frame[], Frame[]] = [[], []];
  for (let block = 0; block < BLOCKS; block++) {
    still.push(...(await page.evaluate((frames) => window.scenes!.still(frames), FRAMES)));
    animated.push(...(await page.evaluate((frames) => window.scenes!.animated(frames), FRAMES)));
  }
  await browser.close();
  await pages.close();
  await chat.stop();

  const median = (frames: Frame[]) => quantile(frames.map(({ ms }) => ms), 0.5);
  const cost = median(animated) / median(still);
  const changes = animated.filter((frame, i) => {
    const around = animated.slice(Math.max(0, i - 1), i + 2);
    return around.some(({ window, uploaded }) => uploaded || window !== frame.window);
  });
  const longest = Math.max(...changes.map(({ ms }) => ms)) / median(animated);
  console.log(
    `animated ${median(animated).toFixed(1)} ms, still ${median(still).toFixed(1)} ms: ×${cost.toFixed(2)} ` +
      `(at most ×${MOST_COST}); longest of ${changes.length} frames at window changes ×${longest.toFixed(2)} ` +
      `of the median (at most ×${LONGEST})`,
  );
  expect(changes.length).toBeGreaterThan(4);
  expect(cost).toBeLessThan(MOST_COST);
  expect(longest).toBeLessThan(LONGEST);
});
