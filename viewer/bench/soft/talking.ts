/**
 * The packaged person while she talks: pictures per second and what their steps take, without WebGL and
 * with software WebGL by turns.
 *
 * Sound plays, lips move, captions change, the body breathes or gestures, the server speaks on the same
 * machine. Pictures have as many pixels as the page chooses while she speaks, as for any visitor; with
 * BEST=1 they are as fine as can be, whatever their rate.
 */
import { existsSync } from 'node:fs';
import { join } from 'node:path';
import type { Page } from 'playwright-core';
import { expect, test } from 'vitest';
import { Browser } from '../../support/browser/browser.ts';
import { pauseDrawing } from '../../support/browser/drawing.ts';
import { drawnBy } from '../../support/browser/path.ts';
import { REPOSITORY } from '../../support/python.ts';
import { ChatServer } from '../../support/servers/server.ts';

const DEMO = join(REPOSITORY, 'src/ico3d/chat/data/demo.ico3d');
const { BEST } = process.env;
const SETTLING = 'who are you'; // in its answer the quality of pictures settles, before anything counts
const QUESTIONS = ['what is ico3d', 'what do I need to record']; // for each path and scene
const FASTER = 5; // than software WebGL
const GESTURES = ['open_hands', 'wave', 'shrug', 'point', 'think'];
const PACE = 2500; // ms from one gesture to the next
const FLIGHT = 3000; // ms until the camera is there
const PATIENCE = { timeout: 60_000 }; // for an answer
const PATHS = ['soft', 'webgl'] as const;
/** Name, view, size, which moments count, and pictures per second that are wanted. */
const SCENES = [
  { name: 'head and chest', view: 'half', size: [900, 700], moments: 'speaking', wanted: 25 },
  { name: 'whole figure', view: 'whole', size: [900, 700], moments: 'gesturing', wanted: 12 },
  { name: 'head and chest', view: 'half', size: [390, 844], moments: 'speaking', wanted: 30 },
  { name: 'whole figure', view: 'whole', size: [390, 844], moments: 'gesturing', wanted: 12 },
] as const;
type Scene = (typeof SCENES)[number];

declare global {
  interface Window {
    watched?: {
      moments: Scene['moments'];
      seconds: number;
      frames: number;
      sums: { [step: string]: number }; // ms
      longest: number; // ms of the main thread's longest task
      underrun: number; // s of silence in all that was said
      gaussians: number;
      pixels: readonly [number, number]; // of the last picture
    };
  }
}

test.skipIf(!existsSync(DEMO))('the packaged person while she talks, by path', async () => {
  const server = await ChatServer.start(DEMO);
  const browsers = await Promise.all(PATHS.map(() => Browser.launch({ hertz: 60 })));
  const pages: Page[] = [];
  for (const [i, path] of PATHS.entries()) {
    const page = await browsers[i]!.open(drawnBy(path, server.url), !BEST);
    await page.waitForFunction(() => window.ico3d!.conversation!.player.heard() !== null, undefined, PATIENCE); // the greeting
    await quiet(page);
    await sample(page);
    pages.push(page);
  }
  const missed: string[] = [];
  for (const scene of SCENES) {
    for (const page of pages) await prepare(page, scene);
    if (!BEST) for (const page of pages) await answer(page, SETTLING);
    for (const page of pages) await count(page, scene);
    for (const question of QUESTIONS) for (const page of pages) await answer(page, question);
    const [soft, webgl] = await Promise.all(pages.map((page) => page.evaluate(() => window.watched!)));
    const rates = [soft!, webgl!].map(({ frames, seconds }) => frames / seconds) as [number, number];
    const steps = ['evaluate', 'project', 'spread', 'bin', 'blend', 'show'].map((step) => (soft!.sums[step]! / soft!.frames).toFixed(1)).join(' | ');
    const row = `${scene.name}, ${scene.moments} | ${scene.size.join(' × ')} | ${soft!.pixels.join(' × ')}`;
    const ratio = rates[0] / rates[1];
    console.log(`| ${row} | ${soft!.gaussians} | ${steps} | ${rates.map((rate) => rate.toFixed(1)).join(' | ')} | ×${ratio.toFixed(1)} | ${soft!.longest.toFixed(0)} | ${(1000 * soft!.underrun).toFixed(0)} |`);
    if (!(rates[0] >= scene.wanted && ratio >= FASTER)) missed.push(row);
  }
  for (const browser of browsers) await browser.close();
  await server.stop();
  expect(missed).toEqual([]);
});

/** Flies to a scene; then the page rests. */
async function prepare(page: Page, { view, size: [width, height] }: Scene): Promise<void> {
  await page.setViewportSize({ width, height });
  await page.evaluate((view) => {
    window.ico3d!.stage.start();
    window.ico3d!.stage.orbit.show(view);
  }, view);
  await page.waitForTimeout(FLIGHT);
  await pauseDrawing(page);
}

/** Counts from now on. */
async function count(page: Page, { moments }: Scene): Promise<void> {
  await page.evaluate((moments) => (window.watched = { moments, seconds: 0, frames: 0, sums: {}, longest: 0, underrun: 0, gaussians: 0, pixels: [0, 0] }), moments);
}

/** Asks, and draws until the answer was heard. */
async function answer(page: Page, question: string): Promise<void> {
  await page.evaluate(() => window.ico3d!.stage.start());
  await page.fill('#text', question);
  await page.keyboard.press('Enter');
  await page.waitForFunction(() => window.ico3d!.conversation!.player.heard() !== null, undefined, PATIENCE);
  await quiet(page);
  await pauseDrawing(page);
}

async function quiet(page: Page): Promise<void> {
  await page.waitForFunction(() => window.ico3d!.conversation!.player.heard() === null, undefined, PATIENCE);
}

/** Adds up what the page draws in the moments in question. Where she is to gesture, gesture follows gesture. */
function sample(page: Page): Promise<void> {
  return page.evaluate(
    ({ gestures, pace }) => {
      const { stage, conversation, acting } = window.ico3d!;
      const { player } = conversation!;
      let before = { now: 0, frames: 0, silence: 0, counts: false };
      let made = 0;
      const look = (now: number) => {
        requestAnimationFrame(look);
        const { watched } = window;
        const heard = player.heard();
        const counts = heard !== null && !heard.paused;
        if (counts && watched?.moments === 'gesturing' && now > pace * made) {
          made = Math.ceil(now / pace);
          if (!acting!.language.make(gestures[made % gestures.length]!)) throw new Error('she has no such gesture');
        }
        const drawn = stage.frames - before.frames;
        if (watched && counts && before.counts) {
          watched.seconds += (now - before.now) / 1000;
          watched.frames += drawn;
          watched.underrun += Math.max(0, player.underrun - before.silence);
          ({ gaussians: watched.gaussians, pixels: watched.pixels } = stage.figures);
          const steps = { evaluate: stage.figures.evaluation, ...(stage.painter as { steps?: object }).steps } as { [step: string]: number };
          for (const [step, took] of Object.entries(steps)) watched.sums[step] = (watched.sums[step] ?? 0) + drawn * took;
        }
        before = { now, frames: stage.frames, silence: player.underrun, counts };
      };
      requestAnimationFrame(look);
      new PerformanceObserver((list) => {
        const { watched } = window;
        for (const { duration } of list.getEntries()) if (watched && before.counts) watched.longest = Math.max(watched.longest, duration);
      }).observe({ type: 'longtask' });
    },
    { gestures: GESTURES, pace: PACE },
  );
}
