/**
 * Whether memory stays flat while somebody talks: the page's heap after collection, buffers, what the
 * GPU holds, nodes and listeners, at the end of each of many turns with a whole person; and whose the
 * bytes are by which the heap grew.
 */
import type { CDPSession, Page } from 'playwright-core';
import { expect, test } from 'vitest';
import { Browser } from '../support/browser/browser.ts';
import { drawSeldom } from '../support/browser/drawing.ts';
import { drawnBy } from '../support/browser/path.ts';
import { makePerson } from '../support/references/person.ts';
import { ChatServer } from '../support/servers/server.ts';
import { heapByKind, type Kinds } from './page/heap.ts';

const SECONDS = Number(process.env.ICO3D_BENCH_SECONDS ?? 120); // of talk
const WARM = 0.25; // share of the turns that do not count: programs are compiled, windows come
const MOST_GROWTH = 0.3; // MB/min of the heap, most of it machine code: it is compiled for what is called often
const MOST_OF_SCRIPTS = 0.03; // MB/min of what scripts hold, among it the transcript
const NODES = 8; // of the page for each row of the transcript
const QUESTIONS = ['tell me about yourself', 'who are you', 'a new home in the stars'];

/** What the page holds. */
interface Held {
  at: number; // s
  heap: number; // MB
  stores: number; // MB, of buffers
  textures: number;
  geometries: number;
  programs: number;
  nodes: number; // without those of the transcript, which is meant to grow
  listeners: number;
}

test(`memory over ${SECONDS} s of talk`, async () => {
  const person = makePerson({ gaussians: '600,600' });
  const server = await ChatServer.start(person.file);
  const browser = await Browser.launch({ width: 160, height: 120 });
  const page = await browser.open(drawnBy('webgl', server.url));
  await drawSeldom(page, 16);
  const cdp = await page.context().newCDPSession(page);
  await cdp.send('Performance.enable');
  const held: Held[] = [];
  const begun = performance.now();
  const seconds = () => (performance.now() - begun) / 1000;
  let first: { at: number; kinds: Kinds } | null = null;
  for (let turn = 0; seconds() < SECONDS; turn++) {
    if (!first && seconds() > WARM * SECONDS) first = { at: seconds(), kinds: await heapByKind(cdp) };
    // Not typed: browsers keep what was typed to undo it.
    await page.evaluate((question) => window.ico3d!.conversation!.ask(question), QUESTIONS[turn % QUESTIONS.length]!);
    await page.waitForFunction(() => window.ico3d!.conversation!.player.heard() !== null, undefined, { timeout: 30_000 });
    await page.waitForTimeout(2500);
    await page.evaluate(() => window.ico3d!.conversation!.interrupt());
    await page.waitForFunction(() => window.ico3d!.conversation!.player.heard() === null);
    held.push({ at: seconds(), ...(await measure(page, cdp)) });
  }
  const minutes = (seconds() - first!.at) / 60;
  const last = await heapByKind(cdp);
  const grown = (kind: keyof Kinds) => (last[kind] - first!.kinds[kind]) / 1e6 / minutes;
  await browser.close();
  await server.stop();

  console.table(held.filter((_, i) => i % 4 === 0 || i === held.length - 1));
  const settled = held.slice(Math.ceil(WARM * held.length));
  const growth = 60 * slope(settled.map(({ at, heap }) => [at, heap]));
  const late = settled.slice(Math.ceil(settled.length / 2));
  const growthLate = 60 * slope(late.map(({ at, heap }) => [at, heap]));
  console.log(`${held.length} turns, heap grows by ${growth.toFixed(3)} MB a minute, in the second half of that time by ${growthLate.toFixed(3)}`);
  for (const kind of ['code', 'browser', 'scripts'] as const) console.log(`${kind}: ${grown(kind).toFixed(4)} MB a minute`);
  for (const key of ['textures', 'geometries', 'programs'] as const) {
    expect(new Set(settled.map((one) => one[key])).size, key).toBe(1);
  }
  for (const key of ['nodes', 'listeners'] as const) expect(settled.at(-1)![key], key).toBeLessThan(settled[0]![key] + 20);
  expect(growth).toBeLessThan(MOST_GROWTH);
  expect(grown('scripts')).toBeLessThan(MOST_OF_SCRIPTS);
});

async function measure(page: Page, cdp: CDPSession): Promise<Omit<Held, 'at'>> {
  await cdp.send('HeapProfiler.collectGarbage');
  const { usedSize, backingStorageSize } = await cdp.send('Runtime.getHeapUsage');
  const { metrics } = await cdp.send('Performance.getMetrics');
  const metric = (name: string) => metrics.find((one) => one.name === name)!.value;
  const { rows, ...gpu } = await page.evaluate(() => {
    const { memory, programs } = window.ico3d!.stage.renderer.info;
    return { ...memory, programs: programs!.length, rows: document.querySelectorAll('#record > div').length };
  });
  return { heap: usedSize / 1e6, stores: backingStorageSize / 1e6, ...gpu, nodes: metric('Nodes') - NODES * rows, listeners: metric('JSEventListeners') };
}

/** Of the straight line nearest to points, by least squares. */
function slope(points: [number, number][]): number {
  const mean = (axis: 0 | 1) => points.reduce((sum, point) => sum + point[axis], 0) / points.length;
  const [x0, y0] = [mean(0), mean(1)];
  const over = points.reduce((sum, [x, y]) => sum + (x - x0) * (y - y0), 0);
  return over / points.reduce((sum, [x]) => sum + (x - x0) ** 2, 0);
}
