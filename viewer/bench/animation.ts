/**
 * What animation costs: frames of a whole person who speaks and gestures, against frames of the
 * same splats that stand still behind an identity modifier and are updated each tick as well.
 */
import { createServer } from 'vite';
import { expect, test } from 'vitest';
import { Browser } from '../support/browser/browser.ts';
import { makePerson } from '../support/references/person.ts';
import { psnr, takePixels } from '../support/browser/pictures.ts';
import { processorTime } from '../support/processor.ts';
import { REPOSITORY } from '../support/python.ts';
import { servePage } from '../support/servers/static.ts';
import { quantile } from '../support/statistics.ts';
import type { Frame } from './page/scenes.ts';

const GAUSSIANS = '3500,2500'; // on the head, on the body
const [WIDTH, HEIGHT] = [240, 320];
const BLOCKS = 5; // of either scene, in turns: a busy machine slows both
const FRAMES = 24; // in a block
const MOST_COST = 1.25; // of the still scene
const LONGEST = 3; // of the median
const SCENES = ['still', 'animated'] as const;
type Scene = (typeof SCENES)[number];

test('an animated person against the same splats at rest', async () => {
  const files = await servePage(makePerson({ gaussians: GAUSSIANS }).folder); // without a conversation
  const proxy = { '/bundle': files.url, '/ws': files.url };
  const pages = await createServer({ root: `${REPOSITORY}viewer`, logLevel: 'error', server: { port: 0, host: '127.0.0.1', proxy } });
  await pages.listen();
  const browser = await Browser.launch({ width: WIDTH, height: HEIGHT });
  const { page } = browser;
  await browser.open(pages.resolvedUrls!.local[0]!);
  await page.evaluate(() => window.ico3d!.stage.still());
  await page.addScriptTag({ type: 'module', url: '/bench/page/scenes.ts' });
  await page.waitForFunction(() => window.scenes !== undefined, undefined, { timeout: 120_000 });
  const looks = [];
  for (const scene of SCENES) {
    await page.evaluate((name) => window.scenes![name](1), scene);
    looks.push(await takePixels(page));
  }
  const likeness = psnr(looks[0]!, looks[1]!);
  const frames: Record<Scene, Frame[]> = { animated: [], still: [] };
  const used: Record<Scene, number> = { animated: 0, still: 0 };
  for (let turn = 0; turn < 2 * BLOCKS; turn++) {
    const scene = SCENES[turn % 2]!;
    const before = processorTime();
    frames[scene].push(...(await page.evaluate(([name, count]) => window.scenes![name](count), [scene, FRAMES] as const)));
    used[scene] += processorTime() - before;
  }
  const { animated, still } = frames;
  await browser.close();
  await pages.close();
  files.close();

  const changing = animated.map((frame, i) =>
    animated.slice(Math.max(0, i - 1), i + 2).some(({ window, uploaded }) => uploaded || window !== frame.window),
  );
  const times = (frames: Frame[]) => frames.map(({ ms }) => ms);
  const [moving, standing] = [times(animated), times(still)];
  const median = quantile(moving, 0.5);
  const cost = median / quantile(standing, 0.5);
  const changes = times(animated.filter((_, i) => changing[i]));
  const longest = Math.max(...changes) / median;
  const noise = Math.max(...standing) / quantile(standing, 0.5); // what the machine does to any frame
  console.log(
    `frame time animated / still: ×${cost.toFixed(2)} (at most ×${MOST_COST}), median ${median.toFixed(0)} ` +
      `and ${quantile(standing, 0.5).toFixed(0)} ms; processor time, with what fetches, unpacks and sorts ` +
      `beside: ×${(used.animated / used.still).toFixed(2)}; scenes alike by ${likeness.toFixed(1)} dB`,
  );
  console.log(
    `${changes.length} frames around window changes: median ×${(quantile(changes, 0.5) / median).toFixed(2)} of all, ` +
      `longest ×${longest.toFixed(2)} (at most ×${LONGEST}); longest of the still scene ×${noise.toFixed(2)}`,
  );
  expect(likeness).toBeGreaterThan(25); // but for a motion of some hundredths of a second
  expect(changes.length).toBeGreaterThan(4);
  expect(cost).toBeLessThan(MOST_COST);
  expect(longest).toBeLessThan(Math.max(LONGEST, noise));
});
