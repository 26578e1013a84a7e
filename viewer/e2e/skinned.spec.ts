import type { Page } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, test } from 'vitest';
import type { mountAvatar } from '../src/embed/api.ts';
import type { Playback } from '../src/motion/playback.ts';
import type { Presence } from '../src/visit.ts';
import { Browser } from '../support/browser/browser.ts';
import { drawnBy } from '../support/browser/path.ts';
import { lookAsBundled, psnr, takePixels, worst } from '../support/browser/pictures.ts';
import { makePerson } from '../support/references/person.ts';
import { makeSkinned, type SkinnedMoment } from '../support/references/skinned.ts';
import { ChatServer } from '../support/servers/server.ts';
import { servePage } from '../support/servers/static.ts';

declare global {
  interface Window {
    mountAvatar: typeof mountAvatar;
  }
}

const WIDTH = 120;
const HEIGHT = 160;
const GAUSSIANS = 3000;
const FEW = 1200; // the most important ones
const TIMES = [0, 0.31, 1.2, 2];
const LIKENESS = 45; // dB
const reference = makeSkinned({ gaussians: GAUSSIANS, times: TIMES, few: FEW, pictures: `${WIDTH}x${HEIGHT}` });
const pixels = 3 * WIDTH * HEIGHT;
const unseen = reference.moments.at(-1)!;

let server: ChatServer;
let browser: Browser;
let page: Page;

beforeAll(async () => {
  server = await ChatServer.start(reference.file);
  browser = await Browser.launch({ width: WIDTH, height: HEIGHT });
  page = await browser.open(drawnBy('webgl', server.url));
});

afterAll(async () => {
  await browser?.close();
  await server?.stop();
});

/** Compares what is drawn with what Python draws, splat by splat and as a picture. */
async function expectAsInPython(moment: SkinnedMoment, picture: number, count = GAUSSIANS): Promise<void> {
  await page.evaluate(() => window.ico3d!.stage.still());
  const taken = await takePixels(page);
  const splats = await page.evaluate(() => {
    const { skinned, splats } = window.ico3d!;
    const { centres, rgba } = splats(skinned!.generator);
    return { centres: [...centres], rgba: [...rgba] };
  });
  expect(worst(moment.centres.subarray(0, 3 * count), splats.centres.slice(0, 3 * count))).toBeLessThan(1e-5);
  expect(worst(moment.rgba.subarray(0, 4 * count), splats.rgba.slice(0, 4 * count))).toBeLessThan(1e-3);
  const likeness = psnr(taken, reference.pictures!.subarray(picture * pixels, (picture + 1) * pixels));
  console.log(`${moment.time ?? 'unseen'}, ${count} Gaussians: ${likeness.toFixed(1)} dB`);
  expect(likeness).toBeGreaterThan(LIKENESS);
}

/** Takes the pose that was never recorded. */
function strike(): Promise<void> {
  return page.evaluate(({ rotations, root }) => window.ico3d!.skinned!.strike(rotations, root), unseen);
}

describe('a body on a skeleton alone, served by ico3d serve', () => {
  test('has a player, and plays what was recorded there and back', async () => {
    expect(await page.locator('#player').isVisible()).toBe(true);
    expect(await page.locator('#composer').isVisible()).toBe(false);
    expect(await page.textContent('#name')).toBe('Random');
    expect(await page.evaluate(() => (window.ico3d!.skinned!.motion as Playback).duration)).toBeCloseTo(2);
    await page.waitForFunction(() => {
      const { skinned } = window.ico3d!;
      const seen = ((window as { seen?: number[] }).seen ??= []);
      seen.push(skinned!.time);
      return Math.max(...seen) > 1.8 && skinned!.time < 1.6;
    });
  });

  test.each(TIMES.map((time, i) => [time, i] as const))('at %f s it is what Python makes of it', async (time, i) => {
    await page.evaluate((seconds) => window.ico3d!.skinned!.show(seconds), time);
    await expectAsInPython(reference.moments[i]!, i);
  });

  test('in a pose that was never recorded it is what Python makes of it', async () => {
    await strike();
    await expectAsInPython(unseen, TIMES.length);
  });

  test('the most important Gaussians alone are a body, too; then all of them go on with the recording', async () => {
    await strike();
    await page.evaluate((few) => window.ico3d!.skinned!.generator.limit(few), FEW);
    await expectAsInPython(unseen, TIMES.length + 1, FEW);
    await page.evaluate((all) => window.ico3d!.skinned!.generator.limit(all), GAUSSIANS);
    await page.evaluate(() => window.ico3d!.skinned!.release());
    await page.evaluate((seconds) => window.ico3d!.skinned!.show(seconds), TIMES[1]!);
    await expectAsInPython(reference.moments[1]!, 1);
  });

  test('mounted by itself it takes the same pose, goes on with the recording, and refuses a pose of others', async () => {
    await strike();
    await page.evaluate("import(new URL('embed.js', location.href)).then(({ mountAvatar }) => void Object.assign(window, { mountAvatar }))");
    const seen = await page.evaluate(async ({ rotations, root }) => {
      const place = document.body.appendChild(document.createElement('div'));
      place.style.cssText = 'position: fixed; width: 40px; height: 40px';
      const handle = await window.mountAvatar(place, { bundle: 'bundle', calm: true });
      const { skinned } = (handle as unknown as { cast: Pick<Presence, 'skinned'> }).cast;
      const pose = { rotations: Array.from({ length: rotations.length / 4 }, (_, i) => rotations.slice(4 * i, 4 * i + 4)), root };
      const before = [...skinned!.points];
      handle.pose(pose as Parameters<typeof handle.pose>[0]);
      const posed = [...skinned!.points];
      let refusal = '';
      try {
        handle.pose({ rotations: [], root: [0, 0, 0] });
      } catch (error) {
        refusal = (error as Error).message;
      }
      handle.pose(null);
      const after = [...skinned!.points];
      handle.dispose();
      place.remove();
      return { before, posed, after, refusal, wanted: [...window.ico3d!.skinned!.points] };
    }, { rotations: [...unseen.rotations], root: [...unseen.root] as [number, number, number] });
    expect(worst(seen.posed, seen.wanted)).toBeLessThan(1e-6);
    expect(worst(seen.before, seen.wanted)).toBeGreaterThan(0.05);
    expect(seen.after).toEqual(seen.before);
    expect(seen.refusal).toMatch(/^A pose of this body has \d+ joints/);
  });

  test('a damaged file is one sentence on the page', async () => {
    await page.route('**/body/skinned.safetensors*', (route) => route.fulfill({ body: 'x'.repeat(100) }));
    await page.reload();
    const sentence = page.locator('#overlay-error');
    await sentence.waitFor();
    expect(await sentence.textContent()).toBe('body/skinned.safetensors is shorter than manifest.json says.');
    await page.unroute('**/body/skinned.safetensors*');
  });
});

describe('a whole person on a skeleton', () => {
  const whole = makePerson({ body: 'skinned', gaussians: '400,2000', times: [0, 2.4], pictures: `${WIDTH}x${HEIGHT}` });
  let files: Awaited<ReturnType<typeof servePage>>;

  beforeAll(async () => {
    files = await servePage(whole.folder);
    page = await browser.open(drawnBy('webgl', files.url));
    await lookAsBundled(page, whole.folder);
  });
  afterAll(() => files?.close());

  test.each([0, 2.4].map((time, i) => [time, i] as const))('at %f s head and body are what Python makes of them', async (time, i) => {
    await page.evaluate(async (seconds) => {
      const { stage, skinned, head } = window.ico3d!;
      head!.director = null;
      await skinned!.show(seconds);
      head!.tick(0);
      head!.express(new Float32Array(head!.expression.length));
      await stage.still();
    }, time);
    const row = await page.evaluate(() => window.ico3d!.head!.row);
    expect(row).toBeCloseTo(time * whole.fps, 5);
    const likeness = psnr(await takePixels(page), whole.pictures!.subarray(i * pixels, (i + 1) * pixels));
    console.log(`whole, ${time} s: ${likeness.toFixed(1)} dB`);
    expect(likeness).toBeGreaterThan(LIKENESS);
  });

  test('rests where its animation says, and the head goes with the body', async () => {
    const seen = await page.evaluate(async () => {
      const { stage, skinned, head } = window.ico3d!;
      stage.start();
      const steps: [number, number][] = [];
      for (let i = 0; i < 40; i++) {
        await new Promise((resolve) => requestAnimationFrame(resolve));
        steps.push([skinned!.time, head!.row]);
      }
      return steps;
    });
    for (const [time, row] of seen) expect(row).toBeCloseTo(time * whole.fps, 5);
  });
});
