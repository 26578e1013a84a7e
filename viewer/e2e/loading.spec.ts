import { afterAll, beforeAll, describe, expect, inject, test } from 'vitest';
import { Browser } from '../support/browser/browser.ts';
import { drawnBy } from '../support/browser/path.ts';
import { watchWire, type Wire } from '../support/browser/wire.ts';
import { SlowLine } from '../support/servers/slow.ts';
import { slowness } from '../support/slowness.ts';

const RATE = 10e6; // bit/s
const LATENCY = 40; // ms, there and back
const LONGEST = 6; // s to a face
const MOST_BYTES = 3e6; // until a face is seen
const MOST_SCRIPT = 1.2e6; // bytes of it
const SECOND_VISIT = 30e3; // bytes: the page and the manifest
const { demoUrl } = inject('shared');

/** Opens a page and gives the seconds until its first screen has a name, and until somebody is drawn. */
async function visit(url: string, browser: Browser): Promise<[named: number, drawn: number]> {
  const { page } = browser;
  const begun = performance.now();
  const since = () => (performance.now() - begun) / 1000;
  await page.goto(drawnBy('webgl', url), { waitUntil: 'commit' });
  await page.waitForFunction(() => document.getElementById('name')?.textContent);
  const named = since();
  await page.waitForFunction(() => (window.ico3d?.stage.frames ?? 0) > 0);
  return [named, since()];
}

describe.skipIf(!demoUrl)('a first visit to the packaged person at 10 Mbit/s (needs src/ico3d/chat/data/demo.ico3d)', () => {
  let line: SlowLine;
  let browser: Browser;
  let wire: Wire;
  let seconds: number;
  let first: Wire;

  beforeAll(async () => {
    browser = await Browser.launch({ width: 160, height: 120, calm: true });
    line = await SlowLine.to(demoUrl!, RATE, LATENCY);
    wire = await watchWire(browser.page);
    const [named, drawn] = await visit(line.url, browser);
    seconds = drawn;
    first = structuredClone(wire);
    console.log(`a name after ${named.toFixed(2)} s, a face after ${seconds.toFixed(2)} s, ${(first.bytes / 1e6).toFixed(2)} MB, ${(first.scripts / 1e6).toFixed(2)} MB of it script`);
  });

  afterAll(async () => {
    await browser?.close();
    line?.close();
  });

  test('shows a face soon, after few bytes', () => {
    expect(seconds).toBeLessThan(LONGEST * slowness());
    expect(first.bytes).toBeLessThan(MOST_BYTES * slowness()); // more comes while a busy machine draws
    expect(first.scripts).toBeGreaterThan(0.5e6); // it was counted
    expect(first.scripts).toBeLessThan(MOST_SCRIPT);
  });

  test('asks for the face before anything else of the avatar, beside the script', () => {
    const asked = first.names.filter((name) => name.startsWith('bundle/'));
    expect(asked.slice(0, 2)).toEqual(['bundle/manifest.json', 'bundle/head.safetensors']);
    const unused = first.names.filter((name, i) => first.names.indexOf(name) !== i);
    expect(unused, 'what was asked for twice').toEqual([]);
  });

  test('keeps all of it but the page and the manifest for the next visit', async () => {
    await browser.page.waitForLoadState('networkidle'); // windows of the body that come after the first picture
    const before = wire.bytes;
    await visit(line.url, browser);
    expect(wire.bytes - before).toBeLessThan(SECOND_VISIT);
  });
});
