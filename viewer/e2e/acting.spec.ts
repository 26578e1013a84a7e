import { join } from 'node:path';
import type { Page } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, test } from 'vitest';
import { add, rotate, subtract, type Vector } from '../src/rig/quaternions.ts';
import type { RigPose } from '../src/gesture/placement.ts';
import { Rig } from '../src/rig/rig.ts';
import { EYE_UNIT } from '../src/shared.ts';
import type { Browser } from '../support/browser/browser.ts';
import { finished, openPage, until } from '../support/browser/talk.ts';
import { runFork } from '../support/python.ts';
import { scratchFolder } from '../support/scratch.ts';
import { ChatServer } from '../support/servers/server.ts';

const YAW = 0.5; // rad, as recorded
const MOST_TURN = 0.2; // rad, of the eyes
const PLACE: Vector = [0.4, 0, -0.3]; // m

/** How the body and the head were at a moment. */
interface Sample {
  pose: RigPose;
  head: Vector; // m
  eyes: number; // radians to the person's left, against the head
}

declare global {
  interface Window {
    samples: Sample[];
  }
}

let server: ChatServer;
let browser: Browser;
let page: Page;
let rig: Rig;
let names: string[];

beforeAll(async () => {
  const folder = scratchFolder();
  runFork('references/gestures/acting_person.py', folder);
  server = await ChatServer.start(join(folder, 'person.ico3d'));
  browser = await openPage(server.url);
  page = browser.page;
  const bones = await page.evaluate((UNIT) => {
    window.samples = [];
    setInterval(() => {
      const { acting, head } = window.ico3d!;
      const { position, steps } = head!.generator;
      window.samples.push({ pose: acting!.pose, head: position.toArray(), eyes: steps.at(-2)! / UNIT });
    }, 50);
    const { parents, joints } = window.ico3d!.skinned!.generator.skeleton.rig;
    return { parents, joints };
  }, EYE_UNIT);
  rig = new Rig(bones.parents, bones.joints);
  names = await page.evaluate(async () => (await (await fetch('bundle/manifest.json')).json()).skinned.names as string[]);
});

afterAll(async () => {
  await browser?.close();
  await server?.stop();
});

/** Metres of a joint at each sample so far. */
async function places(name: string): Promise<Vector[]> {
  const samples = await page.evaluate(() => window.samples);
  return samples.map(({ pose }) => rig.posed(pose.rotations, pose.root).places[names.indexOf(name)]!);
}

/** Radians to the person's left that a joint is turned about the vertical at each sample so far. */
async function yaws(name: string): Promise<number[]> {
  const samples = await page.evaluate(() => window.samples);
  return samples.map(({ pose }) => {
    const [x, , z] = rotate(rig.posed(pose.rotations, pose.root).turned[names.indexOf(name)]!, [0, 0, 1]);
    return Math.atan2(x, z) - YAW;
  });
}

/** A point in the world, at the height of the eyes, in some direction of the person and so many metres away. */
function visitorAt(yaw: number, away = 2.5): Vector {
  return add(PLACE, [away * Math.sin(yaw), 1.6, away * Math.cos(yaw)]);
}

/** Puts the visitor somewhere, and forgets what was seen before. */
async function visit(eye: Vector): Promise<void> {
  await page.evaluate(
    ([eye, target]) => {
      window.samples.length = 0;
      window.ico3d!.stage.orbit.look({ eye: [...eye!], target: [...target!], up: [0, 1, 0], fov_y: 30 });
    },
    [eye, add(PLACE, [0, 1.2, 0])],
  );
}

describe('a whole person on a skeleton in a conversation', () => {
  test('stands where it was recorded, breathes, and its feet stay', async () => {
    await until(browser, finished(0)); // the greeting
    await page.waitForFunction(() => window.samples.length > 10);
    for (const side of ['left', 'right']) {
      const ankles = await places(`${side}_ankle`);
      expect(ankles.length).toBeGreaterThan(10);
      for (const ankle of ankles) ankle.forEach((value, axis) => expect(value).toBeCloseTo(ankles[0]![axis]!, 3));
    }
    const [left, right] = [(await places('left_ankle'))[0]!, (await places('right_ankle'))[0]!];
    const across = subtract(left, right);
    expect(Math.atan2(-across[2], across[0])).toBeCloseTo(YAW, 2);
    expect((left[0] + right[0]) / 2).toBeCloseTo(PLACE[0] - 0.01 * Math.sin(YAW), 2);
    const heads = await places('head');
    expect(Math.max(...heads.map(([x]) => x)) - Math.min(...heads.map(([x]) => x))).toBeGreaterThan(1e-4);
  });

  test('waves as it was recorded when it is asked to, with its head on its neck', async () => {
    await page.evaluate(() => (window.samples.length = 0));
    await page.fill('#text', 'Can you wave at me and tell me about yourself?');
    await page.keyboard.press('Enter');
    const { received } = await until(browser, finished(1));
    const cues = received.filter(({ type }) => type === 'cues').flatMap((message) => message.cues as { name: string }[]);
    expect(cues.map(({ name }) => name)).toContain('wave');
    expect(received.filter(({ type }) => type === 'timeline')).toEqual([]);
    const [wrists, shoulders] = [await places('left_wrist'), await places('left_shoulder')]; // the package waves with the right hand
    expect(Math.max(...wrists.map(([, y], i) => y - shoulders[i]![1]))).toBeGreaterThan(0); // a hand above the shoulder
    expect(Math.min(...wrists.map(([, y], i) => y - shoulders[i]![1]))).toBeLessThan(-0.3); // and down
    const samples = await page.evaluate(() => window.samples);
    const held = samples.map(({ pose, head }) => {
      const { turned, places: at } = rig.posed(pose.rotations, pose.root);
      const joint = names.indexOf('head');
      const [w, x, y, z] = turned[joint]!;
      return rotate([w, -x, -y, -z], subtract(head, at[joint]!)); // as the joint sees it
    });
    for (const place of held) place.forEach((value, axis) => expect(value).toBeCloseTo(held[0]![axis]!, 5));
    console.log(`${cues.length} cues: ${cues.map(({ name }) => name)}`);
  });

  test('turns to a visitor who goes to the side, the head before the chest, over feet that stay', async () => {
    const feet = (await places('left_ankle')).at(-1)!;
    for (const aside of [1, -0.9]) {
      await visit(visitorAt(YAW + aside));
      await expect.poll(async () => Math.abs((await yaws('head')).at(-1)! - aside)).toBeLessThan(0.08);
      const wanted = Math.sign(aside) * 0.4 * (Math.abs(aside) - Math.PI / 12);
      await expect.poll(async () => Math.abs((await yaws('spine3')).at(-1)! - wanted)).toBeLessThan(0.08);
      const [head, chest] = [await yaws('head'), await yaws('spine3')];
      expect(Math.abs(head.at(-1)! - aside)).toBeLessThan(0.12); // it wanders by some degrees
      const half = (angles: number[]) => angles.findIndex((angle) => (angle - angles[0]!) / (angles.at(-1)! - angles[0]!) > 0.5);
      expect(half(head)).toBeLessThanOrEqual(half(chest));
      expect(half(head)).toBeGreaterThan(0); // it takes its time
      const eyes = await page.evaluate(() => window.samples.map((sample) => sample.eyes));
      const first = eyes.findIndex((angle) => angle * Math.sign(aside) > MOST_TURN - 1e-6); // as far as they go
      expect(first).toBeGreaterThanOrEqual(0);
      expect(first).toBeLessThan(half(head)); // they lead
    }
    const stay = (await places('left_ankle')).at(-1)!;
    stay.forEach((value, axis) => expect(value).toBeCloseTo(feet[axis]!, 3));
  });

  test('holds the visitor with its eyes while its head wanders', async () => {
    await visit(visitorAt(YAW - 0.9, 12)); // so far away that both eyes and the mouth lie in one direction
    await page.waitForFunction(() => window.samples.length > 60);
    const eyes = await page.evaluate(() => window.samples.map((sample) => sample.eyes));
    const heads = await yaws('head');
    const middle = (angles: number[]) => angles.toSorted((a, b) => a - b)[angles.length >> 1]!;
    const together = heads.map((angle, i) => angle + eyes[i]!);
    expect(Math.abs(middle(together) + 0.9)).toBeLessThan(0.02); // she looks past somebody now and then
  });
});
