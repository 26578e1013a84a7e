import type { CDPSession, Page } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, inject, test } from 'vitest';
import { Browser } from '../support/browser/browser.ts';
import { drawSeldom, hideBody, refreshed } from '../support/browser/drawing.ts';
import { seeChin, seeEyes } from '../support/browser/eyes.ts';
import { drawnBy } from '../support/browser/path.ts';
import { keepCaptions } from '../support/browser/talk.ts';

const MOST_SCRIPT = 1.2e6; // bytes on the wire until she is seen

const { demoUrl } = inject('shared');

describe.skipIf(!demoUrl)('first sight of the packaged demo', () => {
  let browser: Browser;
  let page: Page;
  let network: CDPSession;
  const sent: { url: string; script: boolean; bytes: number }[] = []; // over the network: 0 bytes from the cache

  beforeAll(async () => {
    browser = await Browser.launch({ width: 480, height: 300, calm: true });
    page = browser.page;
    network = await browser.context.newCDPSession(page);
    const answers = new Map<string, { url: string; script: boolean }>();
    network.on('Network.responseReceived', ({ requestId, type, response: { url } }) => {
      answers.set(requestId, { url, script: type === 'Script' });
    });
    network.on('Network.loadingFinished', ({ requestId, encodedDataLength: bytes }) => {
      const answer = answers.get(requestId);
      if (answer) sent.push({ ...answer, bytes });
    });
    await network.send('Network.enable');
    await browser.open(drawnBy('webgl', demoUrl!));
  });

  afterAll(() => browser?.close());

  /** The shape of the picture; waits until it is fitted and captions, which come first, are there. */
  async function resize(width: number, height: number): Promise<void> {
    await page.setViewportSize({ width, height });
    await page.waitForFunction(
      (size) => {
        const { domElement } = window.ico3d!.stage.renderer;
        const captions = document.querySelector<HTMLElement>('#captions')!;
        return `${domElement.width} ${domElement.height}` === size && !captions.hidden;
      },
      `${width} ${height}`,
    );
    await settled();
  }

  /** The camera has come to rest: frames, captions and zooming move it, on a busy machine for a while. */
  async function settled(): Promise<void> {
    await refreshed(page);
    await page.evaluate(async () => {
      const { camera } = window.ico3d!.stage;
      const place = () => [...camera.matrixWorld.elements, ...camera.projectionMatrix.elements].map((value) => value.toFixed(4)).join();
      for (let [last, since, refreshes] = [place(), performance.now(), 0]; performance.now() - since < 1000 || refreshes < 20; refreshes++) {
        await new Promise(requestAnimationFrame);
        if (place() !== last) [last, since, refreshes] = [place(), performance.now(), 0];
      }
    });
    await refreshed(page);
  }

  test('needs little script, and none of it twice', async () => {
    const scripts = sent.filter(({ script }) => script);
    const bytes = scripts.reduce((sum, file) => sum + file.bytes, 0);
    console.log(`${scripts.length} scripts, ${(bytes / 1e6).toFixed(2)} MB on the wire`);
    expect(bytes).toBeGreaterThan(1e5);
    expect(bytes).toBeLessThan(MOST_SCRIPT);
    sent.length = 0;
    await browser.open(drawnBy('webgl', demoUrl!));
    await drawSeldom(page);
    await hideBody(page);
    const assets = sent.filter(({ url }) => url.includes('/assets/')).map(({ bytes }) => bytes);
    expect(new Set(assets)).toEqual(new Set([0]));
    expect(sent.find(({ url }) => url === drawnBy('webgl', demoUrl!))!.bytes).toBeGreaterThan(0);
    await page.waitForFunction(() => document.body.dataset.state === 'idle');
    await keepCaptions(page);
  });

  test.each([
    ['a desktop', 1280, 800],
    ['a phone', 390, 844],
    ['a phone on its side', 844, 390],
    ['a small phone on its side', 667, 375],
    ['a square', 600, 600],
    ['a small frame', 320, 240],
  ])('on %s: the eyes in the upper third, the face large and clear of all controls', async (_, width, height) => {
    await resize(width, height);
    const { x, y, apart } = await seeEyes(page);
    const chin = await seeChin(page);
    const tops = await page.$$eval('main > :not(#notices):not(.gone)', (parts, middle) => {
      const boxes = parts.map((part) => part.getBoundingClientRect());
      return boxes.filter(({ width, left, right }) => width > 0 && left < middle && right > middle).map(({ top }) => top);
    }, width / 2);
    const scale = Math.min(1, (1.55 * width) / height); // on a narrow picture, shoulders decide
    console.log(`${width}×${height}: eyes ${y.toFixed(3)} from above, ${apart.toFixed(3)} wide, chin ${chin.toFixed(3)}`);
    expect(y).toBeGreaterThan(0.1);
    expect(y).toBeLessThan(1 / 3);
    expect(Math.abs(x - width / height / 2)).toBeLessThan(0.1);
    expect(apart / scale).toBeGreaterThan(0.1); // a face of 22 cm on 80 cm of picture
    expect(Math.min(...tops) / height).toBeGreaterThan(chin);
    const hair = height > 300 ? 1 : 0.1; // in a small frame, with captions of four lines, buttons lie over hair and forehead
    const face = { left: x - apart, right: x + apart, top: y - hair * apart, bottom: chin };
    const over = await page.$$eval('header button', (buttons, [face, height]) => {
      const boxes = buttons.map((button) => button.getBoundingClientRect()).filter(({ width }) => width > 0);
      const across = ({ left, right }: DOMRect) => left < face.right * height && right > face.left * height;
      return boxes.filter((box) => across(box) && box.top < face.bottom * height && box.bottom > face.top * height).length;
    }, [face, height] as const);
    expect(over, 'buttons over the face').toBe(0);
  });

  test('the wheel makes the face large, under the pointer', async () => {
    await resize(480, 300);
    const before = await seeEyes(page);
    await page.mouse.move(before.x * 300, before.y * 300);
    for (let notch = 0; notch < 3; notch++) await page.mouse.wheel(0, -250);
    await settled();
    const after = await seeEyes(page);
    console.log(`eyes ${before.apart.toFixed(3)} wide at ${before.x.toFixed(3)}, ${before.y.toFixed(3)}, then ${after.apart.toFixed(3)} at ${after.x.toFixed(3)}, ${after.y.toFixed(3)}`);
    expect(after.apart / before.apart).toBeGreaterThan(1.8);
    expect(Math.hypot(after.x - before.x, after.y - before.y)).toBeLessThan(0.03);
    for (let notch = 0; notch < 5; notch++) await page.mouse.wheel(0, -250);
    await settled();
    const last = await seeEyes(page);
    expect(last.apart).toBeGreaterThan(0.42); // the face fills the picture
    expect(Math.hypot(last.x - before.x, last.y - before.y)).toBeLessThan(0.06);
    await page.focus('#stage');
    await page.keyboard.press('Home');
    await settled();
    expect((await seeEyes(page)).apart).toBeCloseTo(before.apart, 2);
  });

  test('two fingers make it large between them', async () => {
    await resize(195, 422);
    const before = await seeEyes(page);
    const [x, y] = [before.x * 422, before.y * 422];
    const touch = (type: 'touchStart' | 'touchMove' | 'touchEnd', ...aside: number[]) =>
      network.send('Input.dispatchTouchEvent', { type, touchPoints: aside.map((way, id) => ({ x: x + way, y, id })) });
    await touch('touchStart', -20, 20);
    for (let way = 25; way <= 40; way += 5) await touch('touchMove', -way, way);
    await touch('touchEnd');
    await settled();
    const after = await seeEyes(page);
    expect(after.apart / before.apart).toBeGreaterThan(1.8);
    expect(after.apart / before.apart).toBeLessThan(2.2);
    expect(Math.hypot(after.x - before.x, after.y - before.y)).toBeLessThan(0.1); // the chin stays above the controls
  });

  test('a slash leads to the text box and stays out of it, but not out of a text', async () => {
    const text = () => page.inputValue('#text');
    await page.fill('#text', '');
    await page.focus('#text');
    await page.keyboard.press('/');
    expect(await text()).toBe('');
    await page.focus('#stage');
    await page.keyboard.press('/');
    expect(await text()).toBe('');
    expect(await page.evaluate(() => document.activeElement!.id)).toBe('text');
    await page.keyboard.type('km/h');
    expect(await text()).toBe('km/h');
    await page.focus('#stage');
    await page.keyboard.press('/');
    expect(await text()).toBe('km/h');
  });
});
