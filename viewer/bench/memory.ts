/**
 * Whether memory stays flat while somebody talks: the page's heap after collection, what the GPU
 * holds, nodes and listeners, at the end of each of many turns with a whole person.
 */
import type { CDPSession, Page } from 'playwright-core';
import { expect, test } from 'vitest';
import { Browser } from '../support/browser/browser.ts';
import { drawSeldom } from '../support/browser/drawing.ts';
import { makePerson } from '../support/references/person.ts';
import { ChatServer } from '../support/servers/server.ts';

const SECONDS = Number(process.env.ICO3D_BENCH_SECONDS ?? 120); // of talk
const WARM = 0.25; // share of the turns that do not count: programs are compiled, windows come
const MOST_GROWTH = 0.5; // MB/min of the heap
const QUESTIONS = ['tell me about yourself', 'who are you', 'a new home in the stars'];

/** What the page holds. */
interface Held {
  at: number; // s
  heap: number; // MB
  textures: number;
  geometries: number;
  programs: number;
  nodes: number;
  listeners: number;
}

test(`memory over ${SECONDS} s of talk`, async () => {
  const person = makePerson({ gaussians: '600,600' });
  const server = await ChatServer.start(person.file);
  const browser = await Browser.launch({ width: 160, height: 120 });
  const page = await browser.open(server.url);
  await drawSeldom(page, 16);
  const cdp = await page.context().newCDPSession(page);
  await cdp.send('Performance.enable');
  const held: Held[] = [];
  const begun = performance.now();
  const seconds = () => (performance.now() - begun) / 1000;
  for (let turn = 0; seconds() < SECONDS; turn++) {
    // Not typed: browsers keep what was typed to undo it.
    await page.evaluate((question) => window.ico3d!.conversation!.ask(question), QUESTIONS[turn % QUESTIONS.length]!);
    await page.waitForFunction(() => window.ico3d!.conversation!.player.heard() !== null, undefined, { timeout: 30_000 });
    await page.waitForTimeout(2500);
    await page.evaluate(() => window.ico3d!.conversation!.interrupt());
    await page.waitForFunction(() => window.ico3d!.conversation!.player.heard() === null);
    held.push({ at: seconds(), ...(await measure(page, cdp)) });
  }
  await browser.close();
  await server.stop();

  console.table(held.filter((_, i) => i % 4 === 0 || i === held.length - 1));
  const settled = held.slice(Math.ceil(WARM * held.length));
  const growth = 60 * slope(settled.map(({ at, heap }) => [at, heap]));
  console.log(`${held.length} turns, heap grows by ${growth.toFixed(3)} MB a minute`);
  for (const key of ['textures', 'geometries', 'programs'] as const) {
    expect(new Set(settled.map((one) => one[key])).size, key).toBe(1);
  }
  for (const key of ['nodes', 'listeners'] as const) expect(settled.at(-1)![key], key).toBeLessThan(settled[0]![key] + 20);
  expect(growth).toBeLessThan(MOST_GROWTH);
});

async function measure(page: Page, cdp: CDPSession): Promise<Omit<Held, 'at'>> {
  await cdp.send('HeapProfiler.collectGarbage');
  const { usedSize } = await cdp.send('Runtime.getHeapUsage');
  const { metrics } = await cdp.send('Performance.getMetrics');
  const metric = (name: string) => metrics.find((one) => one.name === name)!.value;
  const gpu = await page.evaluate(() => {
    const { memory, programs } = window.ico3d!.stage.renderer.info;
    return { ...memory, programs: programs!.length };
  });
  return { heap: usedSize / 1e6, ...gpu, nodes: metric('Nodes'), listeners: metric('JSEventListeners') };
}

/** Of the straight line nearest to points, by least squares. */
function slope(points: [number, number][]): number {
  const mean = (axis: 0 | 1) => points.reduce((sum, point) => sum + point[axis], 0) / points.length;
  const [x0, y0] = [mean(0), mean(1)];
  const over = points.reduce((sum, [x, y]) => sum + (x - x0) * (y - y0), 0);
  return over / points.reduce((sum, [x]) => sum + (x - x0) ** 2, 0);
}
