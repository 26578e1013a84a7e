import { join } from 'node:path';
import type { Page } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, inject, test } from 'vitest';
import { Browser } from '../support/browser/browser.ts';
import { drawn, enter, plugIn, seen } from '../support/browser/headset.ts';
import { drawnBy } from '../support/browser/path.ts';
import { runFork, runPython } from '../support/python.ts';
import { scratchFolder } from '../support/scratch.ts';
import { servePage } from '../support/servers/static.ts';

const WIDTH = 240;
const HEIGHT = 160;
const APART = 1.2; // m between visitor and avatar
const EYES_APART = 0.063; // m, of the emulator
const SLOPE = 1; // of the emulator's field of view, 90° from top to bottom
const STEP = 0.1; // m by which somebody jumps from picture to picture

const silence = join(scratchFolder(), 'headset.wav');
beforeAll(() => void runPython('sound/voice.py', silence, '30'));

/** Opens a page for somebody with a headset. */
async function open(url: string): Promise<Browser> {
  const browser = await Browser.launch({ width: WIDTH, height: HEIGHT, microphone: silence });
  await plugIn(browser.page);
  await browser.open(drawnBy('webgl', url));
  await browser.page.evaluate(() => {
    for (const { position } of Object.values(window.headset.controllers)) position.set(0.3, 1, 3); // not in the picture
  });
  return browser;
}

/** Ends the visit as the device's own menu does, and waits for the page. */
async function quit(page: Page): Promise<void> {
  await page.evaluate(() => window.ico3d!.stage.renderer.xr.getSession()!.end());
  await page.waitForFunction(() => !window.ico3d!.stage.renderer.xr.isPresenting);
  await drawn(page, 1);
}

/** The visitor against the person: how far from each other on the floor, how high the eyes are, where the visitor looks. */
function whereabouts(page: Page): Promise<{ apart: number; height: number; ahead: number[]; place: number[] }> {
  return page.evaluate(() => {
    const { camera, ground } = window.immersion();
    const { eyes } = window.ico3d!.stage.meeting!;
    const place = camera.getWorldPosition(eyes.clone());
    const apart = place.clone().sub(eyes).projectOnPlane(ground.up).length();
    const height = place.clone().sub(ground.foot).dot(ground.up);
    return { apart, height, ahead: camera.getWorldDirection(eyes.clone()).toArray(), place: place.toArray() };
  });
}

/** Walks a metre aside and waits until the head has turned there, by a third of what it would take at least. */
async function isLookedAt(page: Page): Promise<void> {
  await page.evaluate(() => void (window.headset.position.x += 1));
  await page.waitForFunction(() => {
    const { head, stage } = window.ico3d!;
    const { ground, camera } = window.immersion();
    const looks = ground.toward.clone().set(0, 0, 1).transformDirection(head!.generator.matrixWorld);
    const way = camera.getWorldPosition(looks.clone()).sub(stage.meeting!.eyes);
    const side = ground.up.clone().cross(ground.toward);
    const aside = (at: typeof way) => Math.atan2(at.dot(side), at.dot(ground.toward));
    const [turned, wanted] = [aside(looks), aside(way)];
    return Math.abs(wanted) > 0.5 && turned / wanted > 1 / 3;
  });
  await page.evaluate(() => void (window.headset.position.x -= 1));
}

/** The page's own camera, once it no longer moves: on a busy machine it finds its place late. */
async function settled(page: Page): Promise<unknown> {
  const camera = () => page.evaluate(() => JSON.stringify(window.ico3d!.stage.orbit.camera.toJSON()));
  for (let before = await camera(); ; ) {
    await page.waitForTimeout(500);
    const now = await camera();
    if (now === before) return JSON.parse(now);
    before = now;
  }
}

describe('somebody on a skeleton, met by headset', () => {
  let browser: Browser;
  let page: Page;
  let close: () => void;

  beforeAll(async () => {
    const folder = scratchFolder();
    runFork('references/gestures/acting_person.py', folder);
    const served = await servePage(join(folder, 'bundle'));
    close = served.close;
    browser = await open(served.url);
    page = browser.page;
  });
  afterAll(async () => {
    await browser?.close();
    close?.();
  });

  test('stands in life size before the visitor, on their floor, and each eye sees her from its own place', async () => {
    const before = await settled(page);
    await enter(page, 'Enter VR');
    const { apart, height } = await whereabouts(page);
    expect(apart).toBeGreaterThan(APART - 0.05);
    expect(apart).toBeLessThan(APART + 0.05);
    expect(height).toBeCloseTo(1.5, 4); // as high as the headset is
    await page.evaluate(() => {
      window.immersion().board.visible = false;
      window.ico3d!.stage.scenery.removeFromParent();
    });
    await drawn(page, 3);
    const [left, right] = await people(page);
    for (const { share } of [left!, right!]) expect(share).toBeGreaterThan(0.01);
    const disparity = left!.x - right!.x;
    const expected = (EYES_APART / APART / SLOPE) * (HEIGHT / 2);
    console.log(`her middle lies ${disparity.toFixed(2)} pixels apart in both eyes, ${expected.toFixed(2)} by geometry`);
    expect(Math.abs(disparity - expected)).toBeLessThan(0.25 * expected);
    await quit(page);
    expect(await settled(page)).toEqual(before);
    const { pixels } = await page.evaluate(() => window.ico3d!.stage.figures);
    expect(pixels).toEqual([WIDTH, HEIGHT]);
  });

  test('body and head are of the same moment as the picture, and look at the visitor', async () => {
    await enter(page, 'Enter VR');
    const late = await page.evaluate(async (step) => {
      const { stage, acting, skinned, head, splats } = window.ico3d!;
      const generators = [skinned!.generator, head!.generator];
      const { count, displacements } = head!.generator.parts[0]!;
      const moves = (i: number) => displacements.some((value, at) => value !== 0 && Math.floor(at / 3) % count === i);
      const still = Array.from({ length: count }, (_, i) => i).findIndex((i) => !moves(i)); // whatever the face does
      const [advance, draw, { rotations, root }] = [stage.advance, stage.draw, acting!.pose];
      const places: number[][] = [];
      let pictures = 0;
      stage.advance = (seconds) => {
        pictures++;
        acting!.held = { rotations, root: [root[0] + step * (pictures % 3), root[1], root[2]] };
        advance.call(stage, seconds);
      };
      stage.draw = () => {
        draw.call(stage);
        places.push(generators.map((generator, i) => splats(generator).centres[i === 0 ? 0 : 3 * still]! - step * (pictures % 3)));
      };
      while (places.length < 7) await new Promise((resolve) => setTimeout(resolve, 20));
      Object.assign(stage, { advance, draw });
      acting!.held = null;
      return generators.map((_, i) => Math.max(...places.slice(1).map((at) => Math.abs(at[i]! - places[1]![i]!))));
    }, STEP);
    console.log(`farthest from where it should be, of body and head: ${late.map((far) => far.toExponential(1)).join(', ')} m`);
    expect(Math.max(...late)).toBeLessThan(1e-3 * STEP);
    await isLookedAt(page);
    await quit(page);
  });

  test('sticks take the visitor elsewhere and turn them; a button leaves', async () => {
    await enter(page, 'Enter VR');
    const stick = async (x: number, y: number) => {
      await page.evaluate(([x, y]) => window.headset.controllers.left!.updateAxes('thumbstick', x!, y!), [x, y]);
      await drawn(page, 3);
    };
    await page.evaluate(() => {
      const { position, quaternion } = window.headset.controllers.left!;
      position.set(0.3, 1, 0.2);
      quaternion.set(0, 1, 0, 0); // away from her
    });
    const before = await whereabouts(page);
    await stick(0, -1);
    expect(await page.evaluate(() => window.immersion().rig.children.filter(({ visible }) => visible).length)).toBe(3);
    await stick(0, 0);
    const gone = await whereabouts(page);
    expect(gone.apart - before.apart).toBeCloseTo(3.5 * Math.sqrt(2 / 9.81), 1); // m: so far flies what is thrown from 1 m
    expect(gone.height).toBeCloseTo(before.height, 4);
    await stick(1, 0);
    const turned = await whereabouts(page);
    const dot = turned.ahead.reduce((sum, value, i) => sum + value * gone.ahead[i]!, 0);
    expect(dot).toBeCloseTo(Math.cos(Math.PI / 6), 4);
    await stick(0, 0);
    const says = (text: string, is = true) => page.waitForFunction(([text, is]) => window.immersion().board.text.includes(text as string) === is, [text, is]);
    await stick(1, 0); // 60° aside
    await says('A or X brings you back');
    await stick(0, 0);
    await page.evaluate(() => window.headset.controllers.right!.updateButtonValue('a-button', 1));
    await drawn(page, 2);
    await page.evaluate(() => window.headset.controllers.right!.updateButtonValue('a-button', 0));
    await says('A or X brings you back', false);
    expect((await whereabouts(page)).apart).toBeCloseTo(1.2, 3);
    await page.evaluate(() => window.headset.controllers.right!.updateButtonValue('b-button', 1));
    await page.waitForFunction(() => !window.ico3d!.stage.renderer.xr.isPresenting);
    await page.evaluate(() => window.headset.controllers.right!.updateButtonValue('b-button', 0));
    await drawn(page, 2);
  });

  test('in a room of the visitor there is nothing around her but the shadow under her feet', async () => {
    await page.evaluate(() => window.headset.quaternion.set(-0.38, 0, 0, 0.92).normalize()); // down, where she stands
    await enter(page, 'View in your room');
    await page.evaluate(() => {
      const { board, rig } = window.immersion();
      board.visible = rig.visible = window.ico3d!.stage.spark.visible = false;
    });
    await drawn(page, 6);
    const { width, height, pixels } = await seen(page);
    const alphas = Array.from({ length: width * height }, (_, i) => pixels[4 * i + 3]!);
    expect(alphas.filter((alpha) => alpha === 0).length / alphas.length).toBeGreaterThan(0.3);
    expect(Math.max(...alphas)).toBeGreaterThan(80);
    expect(Math.max(...alphas)).toBeLessThan(160);
    expect(pixels.every((value, i) => i % 4 === 3 || value === 0)).toBe(true); // it only darkens
    await page.evaluate(() => void (window.ico3d!.stage.spark.visible = true));
    await drawn(page, 3);
    const { pixels: whole } = await seen(page);
    expect(Math.max(...whole.filter((_, i) => i % 4 === 3))).toBe(255); // she hides what is behind her
    await quit(page);
  });

  /** What share of each eye's picture is somebody, and how far from its left edge their middle is, pixels. */
  async function people(page: Page): Promise<{ share: number; x: number }[]> {
    const { width, height, pixels } = await seen(page);
    const behind = pixels.subarray(0, 3);
    return [0, width / 2].map((first) => {
      const columns: number[] = [];
      for (let y = 0; y < height; y++) {
        for (let x = 0; x < width / 2; x++) {
          const at = 4 * (y * width + first + x);
          if (behind.some((value, i) => Math.abs(value - pixels[at + i]!) > 12)) columns.push(x);
        }
      }
      return { share: columns.length / (width * height / 2), x: columns.reduce((sum, x) => sum + x, 0) / columns.length };
    });
  }
});

describe('a talk by headset', () => {
  let browser: Browser;
  let page: Page;

  beforeAll(async () => {
    browser = await open(inject('shared').talkingUrl);
    page = browser.page;
    await enter(page, 'Enter VR');
  });
  afterAll(() => browser?.close());

  test('a head alone is as high as that of somebody who sits, and looks at the visitor', async () => {
    const { apart, height } = await whereabouts(page);
    expect(apart).toBeCloseTo(APART, 1);
    const eyes = await page.evaluate(() => {
      const { eyes, ground } = window.ico3d!.stage.meeting!;
      return eyes.clone().sub(ground.foot).dot(ground.up);
    });
    expect([eyes, height]).toEqual([expect.closeTo(1.2, 4), expect.closeTo(1.5, 4)]);
    await isLookedAt(page);
  });

  test('what is said on the page is read below the face, never over it', async () => {
    const text = () => page.evaluate(() => window.immersion().board.text);
    await page.evaluate(() => {
      document.getElementById('captions')!.hidden = false;
      document.getElementById('answer')!.innerHTML = '<span>Somewhere in </span><span class="unheard">the stars.</span>';
    });
    await drawn(page, 2);
    const talk = await text();
    expect(talk).toContain('Somewhere in');
    expect(talk).not.toContain('the stars'); // that was not heard yet
    expect(talk).toContain('Hold the trigger to talk.');
    await page.evaluate(() => void (document.getElementById('line')!.textContent = 'This device or the line is too slow just now.'));
    await drawn(page, 2);
    expect(await text()).toMatch(/^This device or the line is too slow just now\.\n[^]*Somewhere in/); // above what she says, not instead of it
    await page.evaluate(() => void (document.getElementById('line')!.textContent = ''));
    for (const height of [0.7, 1.5, 2]) {
      await page.evaluate((y) => void (window.headset.position.y = y), height);
      await drawn(page, 2);
      const [chin, top] = await page.evaluate(() => {
        const { camera, board } = window.immersion();
        const { local } = window.ico3d!.stage.meeting!;
        const { height } = board.geometry.parameters;
        const { generator } = window.ico3d!.head!;
        const chin = generator.localToWorld(local!.clone().setY(local!.y - 0.13));
        board.updateMatrixWorld();
        const edge = board.localToWorld(local!.clone().set(0, height / 2, 0));
        return [chin, edge].map((point) => camera.worldToLocal(point)).map(({ y, z }) => y / -z);
      });
      expect(top!).toBeLessThan(chin!);
    }
    await page.evaluate(() => void (window.headset.position.y = 1.5));
  });

  test('it is written once a picture, whatever comes, and a long text in part', async () => {
    const counted = await page.evaluate(async () => {
      const { prototype } = CanvasRenderingContext2D;
      const [{ measureText, roundRect }, counts] = [prototype, { measured: 0, written: 0 }];
      prototype.measureText = function (text) {
        counts.measured += 1;
        return measureText.call(this, text);
      };
      prototype.roundRect = function (...shape) {
        counts.written += 1;
        return roundRect.apply(this, shape);
      };
      const { board } = window.immersion();
      const question = document.getElementById('question')!;
      const before = question.textContent;
      question.textContent = 'a '.repeat(8000);
      for (let i = 0; i < 100; i++) {
        document.getElementById('state')!.dataset.time = `${i}`;
        await Promise.resolve(); // the observer is told
      }
      const soon = counts.written;
      while (counts.written === 0) await new Promise((resolve) => setTimeout(resolve, 20));
      Object.assign(prototype, { measureText, roundRect });
      question.textContent = before;
      return { soon, ...counts, letters: board.text.length };
    });
    expect(counted.soon).toBe(0);
    expect(counted.letters).toBeGreaterThan(15_000);
    expect(counted.measured / counted.written).toBeLessThan(4000); // each word, and each blank, of a part
  });

  test('the trigger is the button to talk', async () => {
    const trigger = (value: number) => page.evaluate((value) => window.headset.controllers.right!.updateButtonValue('trigger', value), value);
    await trigger(1);
    await page.waitForFunction(() => document.getElementById('talk')!.ariaPressed === 'true');
    await page.waitForFunction(() => document.body.dataset.state === 'listening');
    expect(await page.evaluate(() => window.immersion().board.text)).not.toContain('Hold the trigger');
    await trigger(0);
    await page.waitForFunction(() => document.getElementById('talk')!.ariaPressed === 'false');
  });

  test('other tools come with their own hint', async () => {
    const uses = (tool: 'hand' | 'controller') => page.evaluate((tool) => void (window.headset.primaryInputMode = tool), tool);
    const text = () => page.evaluate(() => window.immersion().board.text);
    await uses('hand');
    await page.waitForFunction(() => window.immersion().board.text.includes('Pinch and hold to talk.'));
    expect(await text()).toContain('menu leaves'); // hands have no button for it
    await uses('controller');
    await page.waitForFunction(() => !window.immersion().board.text.includes('Pinch and hold'));
    expect(await text()).not.toContain('Hold the trigger'); // that one was followed
  });

  test('her voice comes from where she is, until the device ends the visit', async () => {
    const turnTo = (turn: number) => page.evaluate((turn) => window.headset.quaternion.set(0, Math.sin(turn / 2), 0, Math.cos(turn / 2)), turn);
    const ears = () => page.evaluate(async () => {
      const { player } = window.ico3d!.conversation!;
      const { context, output } = player;
      const tone = new OscillatorNode(context, { frequency: 900 });
      tone.connect(output);
      tone.start();
      const splitter = new ChannelSplitterNode(context, { numberOfOutputs: 2 });
      const sides = [0, 1].map((side) => {
        const analyser = new AnalyserNode(context, { fftSize: 2048 });
        splitter.connect(analyser, side);
        return analyser;
      });
      const { panner } = window.immersion().voice!;
      panner.connect(splitter);
      const begun = context.currentTime; // sound may come slower than time on a busy machine
      while (context.currentTime < begun + 0.5) await new Promise((resolve) => setTimeout(resolve, 20));
      const levels = sides.map((analyser) => {
        const wave = new Float32Array(analyser.fftSize);
        analyser.getFloatTimeDomainData(wave);
        return Math.sqrt(wave.reduce((sum, value) => sum + value * value, 0) / wave.length);
      });
      tone.stop();
      panner.disconnect(splitter);
      return levels as [number, number];
    });
    await turnTo(Math.PI / 2); // she is at the right then
    await drawn(page, 2);
    const [left, right] = await ears();
    console.log(`at the left ear ${left.toFixed(3)}, at the right ear ${right.toFixed(3)}`);
    expect(right).toBeGreaterThan(1.5 * left);
    await turnTo(-Math.PI / 2);
    await drawn(page, 2);
    const [near, far] = await ears();
    expect(near).toBeGreaterThan(1.5 * far);
    await quit(page);
    expect(await page.evaluate(() => window.ico3d!.stage.scene.children.some(({ type }) => type === 'Group'))).toBe(false);
    await page.evaluate(() => {
      const { context, output } = window.ico3d!.conversation!.player;
      const analyser = new AnalyserNode(context);
      const tone = new OscillatorNode(context);
      tone.connect(output).connect(analyser);
      tone.start();
      Object.assign(window, { analyser });
    });
    await page.waitForFunction(() => {
      const { analyser } = window as unknown as { analyser: AnalyserNode };
      const wave = new Float32Array(analyser.fftSize);
      analyser.getFloatTimeDomainData(wave);
      return Math.max(...wave) > 0.5;
    }); // straight to the loudspeaker
  });
});
