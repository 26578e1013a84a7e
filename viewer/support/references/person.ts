import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import type { Page } from 'playwright-core';
import { drawSeldom } from '../browser/drawing.ts';
import { PATIENCE } from '../patience.ts';
import { runFork } from '../python.ts';
import { scratchFolder } from '../scratch.ts';

/** A whole person, and what Python makes of it (`person_reference.py`). */
export interface PersonReference {
  file: string; // NAME.ico3d
  folder: string; // the bundle's files
  poses: number[][][]; // (F,4,4) of the head
  fps: number;
  rest: [number, number]; // s
  fastest: number; // body seconds per second
  pictures: Buffer | null; // (T, H, W, 3)
  painted: Buffer | null; // the same with the head painted over the body
}

/** Makes the person and draws it with Python at some times. */
export function makePerson(options: { body?: 'windows' | 'skinned'; gaussians?: string; first?: number; times?: number[]; pictures?: string } = {}): PersonReference {
  const out = scratchFolder();
  const args = Object.entries(options).flatMap(([name, value]) => [`--${name}`, String(value)]);
  runFork('references/person_reference.py', out, ...args);
  const folder = join(out, 'bundle');
  const { fps, rest, max_speed: fastest } = JSON.parse(readFileSync(join(folder, 'animation.json'), 'utf8'));
  const drawn = (name: string) => (options.pictures ? readFileSync(join(out, name)) : null);
  return {
    file: join(out, 'person.ico3d'),
    folder,
    poses: JSON.parse(readFileSync(join(out, 'poses.json'), 'utf8')) as number[][][],
    fps,
    rest: [rest.start / fps, rest.end / fps],
    fastest,
    pictures: drawn('pictures.u8'),
    painted: drawn('painted.u8'),
  };
}

/** What a drawn picture showed of a person. */
export interface Step {
  at: number; // s: all that the body was told to go on by
  time: number; // s: of the body
  window: number;
  waiting: boolean;
  head: [number, number]; // m to the side, rad turned
  face: number; // value 0 of the expression
  heard: { utterance: number; seconds: number } | null;
}

const DRAWN = 16; // every so many pictures one is drawn

declare global {
  interface Window {
    steps?: Step[];
  }
}

/**
 * Keeps what every further picture shows; only some are drawn, for that takes most of the time, and
 * enough that windows are sorted before they are seen.
 */
export async function watchSteps(page: Page): Promise<void> {
  await drawSeldom(page, DRAWN);
  await page.evaluate(() => {
    const { stage, body, head, conversation } = window.ico3d!;
    const draw = stage.draw;
    const steps: Step[] = [];
    let at = 0;
    const tick = body!.tick.bind(body);
    body!.tick = (step) => {
      at += step;
      return tick(step);
    };
    window.steps = steps;
    stage.draw = () => {
      draw();
      const { time, window, waiting } = body!.shown!;
      const { position, rotation } = head!.generator;
      const spoken = conversation!.player.heard();
      const heard = spoken && { utterance: spoken.utterance, seconds: spoken.seconds };
      steps.push({ at, time, window, waiting, head: [position.x, rotation.y], face: head!.expression[0]!, heard });
    };
  });
}

/** What the pictures showed so far. */
export async function readSteps(page: Page): Promise<Step[]> {
  return JSON.parse(await page.evaluate(() => JSON.stringify(window.steps))) as Step[];
}

/** Where the head belongs at a body time, (m, rad) as in `Step`. */
export function headAt({ poses, fps }: PersonReference, time: number): [number, number] {
  const row = Math.min(Math.max(time * fps, 0), poses.length - 1);
  const index = Math.min(Math.floor(row), poses.length - 2);
  const parts = [poses[index]!, poses[index + 1]!].map((pose) => [pose[0]![3]!, Math.atan2(pose[0]![2]!, pose[2]![2]!)]);
  const between = (k: number) => parts[0]![k]! + (parts[1]![k]! - parts[0]![k]!) * (row - index);
  return [between(0), between(1)];
}

/** By how many seconds the body moved more than it may from one picture to the next, at most. */
export function excess(steps: Step[], fastest: number): number {
  const moved = steps.slice(1).map(({ time }, i) => Math.abs(time - steps[i]!.time));
  const allowed = steps.slice(1).map(({ at }, i) => fastest * (at - steps[i]!.at));
  return Math.max(...moved.map((way, i) => way - allowed[i]!));
}

/** Whether a picture shows the person within its rest loop. */
export function atRest({ rest: [start, end] }: PersonReference, { time }: Step): boolean {
  return time >= start - 1e-6 && time <= end + 1e-6;
}

/** Waits until the person has been at rest, silent, for two seconds; all that the pictures showed. */
export async function settle(page: Page, person: PersonReference): Promise<Step[]> {
  for (const limit = Date.now() + PATIENCE; Date.now() < limit; ) {
    await page.waitForTimeout(500);
    const steps = await readSteps(page);
    const last = steps.filter(({ at }) => at > steps.at(-1)!.at - 2);
    if (steps.length > 5 && last.every((step) => step.heard === null && atRest(person, step))) return steps;
  }
  throw new Error('the person does not come to rest');
}
