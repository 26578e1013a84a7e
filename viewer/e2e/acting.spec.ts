import { join } from 'node:path';
import type { Page } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, test } from 'vitest';
import { rotate, subtract, type Vector } from '../src/rig/quaternions.ts';
import type { RigPose } from '../src/gesture/placement.ts';
import { Rig } from '../src/rig/rig.ts';
import type { Browser } from '../support/browser/browser.ts';
import { finished, openPage, until } from '../support/browser/talk.ts';
import { runPython } from '../support/python.ts';
import { scratchFolder } from '../support/scratch.ts';
import { ChatServer } from '../support/servers/server.ts';

const YAW = 0.5; // rad, as recorded
const PLACE: Vector = [0.4, 0, -0.3]; // m

/** How the body and the head were at a moment. */
interface Sample {
  pose: RigPose;
  head: Vector; // m
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
  runPython('references/gestures/acting_person.py', folder);
  server = await ChatServer.start(join(folder, 'person.ico3d'));
  browser = await openPage(server.url);
  page = browser.page;
  const bones = await page.evaluate(() => {
    window.samples = [];
    setInterval(() => {
      const { acting, head } = window.ico3d!;
      window.samples.push({ pose: acting!.pose, head: head!.generator.position.toArray() });
    }, 50);
    const { parents, joints } = window.ico3d!.skinned!.generator.skeleton.rig;
    return { parents, joints };
  });
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

describe('a whole person on a skeleton in a conversation', () => {
  test('stands where it was recorded, breathes, and its feet stay', async () => {
    await until(browser, finished(0), 60_000); // the greeting
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

  test('waves when it is asked to, with its head on its neck', async () => {
    await page.evaluate(() => (window.samples.length = 0));
    await page.fill('#text', 'Can you wave at me and tell me about yourself?');
    await page.keyboard.press('Enter');
    const { received } = await until(browser, finished(1), 100_000);
    const cues = received.filter(({ type }) => type === 'cues').flatMap((message) => message.cues as { name: string }[]);
    expect(cues.map(({ name }) => name)).toContain('wave');
    expect(received.filter(({ type }) => type === 'timeline')).toEqual([]);
    const [wrists, shoulders] = [await places('right_wrist'), await places('right_shoulder')];
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
});
