import { Body } from './body/body.ts';
import { Timeline } from './body/timeline.ts';
import { readBakedWindow } from './body/window.ts';
import { BundleFiles } from './bundle/load.ts';
import type { BodyInfo, HeadInfo, Manifest } from './bundle/manifest.ts';
import { Head, sway, type Carrier } from './head/head.ts';
import { MotionDirector, type Spoken } from './motion/director.ts';
import type { Motion } from './motion/motion.ts';
import { Playback } from './motion/playback.ts';
import { makeBackdrop } from './stage/backdrop.ts';
import type { Stage } from './stage/stage.ts';

/** Who is on stage: a head, a body that plays, or a whole person whose body a director moves. */
export interface Cast {
  head?: Head;
  body?: Body;
  playback?: Playback;
  director?: MotionDirector;
}

/** What the cast needs of the page around it. */
export interface CastPorts {
  /** What is heard now. */
  heard(): Spoken | null;
  /** Bytes of a file have come. */
  loaded(bytes: number): void;
  /** A window could not be fetched. */
  failed(error: unknown): void;
}

/**
 * Fetches who is in the bundle and puts them on stage.
 *
 * @param calm the visitor wants little motion: only faces move
 */
export async function makeCast(manifest: Manifest, stage: Stage, calm: boolean, ports: CastPorts): Promise<Cast> {
  const { head, body } = manifest;
  const files = new BundleFiles(manifest.files, ports.loaded);
  const backdrop = await makeBackdrop(files);
  if (backdrop) stage.add(backdrop);
  if (head && body) return makePerson(files, head, body, stage, calm, ports);
  if (head) return { head: await makeHead(files, head, stage, rows(0, calm ? 0 : head.num_poses - 1), calm ? () => 0 : sway(head)) };
  const timeline = new Timeline(body!);
  const playback = new Playback(timeline.duration, !calm);
  return { playback, body: makeBody(files, body!, timeline, playback, stage, ports.failed) };
}

/** Head and body as one: the body's time carries the head. */
async function makePerson(
  files: BundleFiles,
  info: HeadInfo,
  bodyInfo: BodyInfo,
  stage: Stage,
  calm: boolean,
  ports: CastPorts,
): Promise<Cast> {
  const animation = await files.animation(bodyInfo);
  const director = new MotionDirector(animation, () => ports.heard());
  if (calm) director.hold(animation.rest.end / animation.fps);
  // Before the head: it goes where the body is in the same tick.
  const body = makeBody(files, bodyInfo, new Timeline(bodyInfo), director, stage, ports.failed);
  const { start, end } = animation.rest;
  const resting = rows(calm ? end : start, end);
  const head = await makeHead(files, info, stage, resting, () => body.time * info.fps);
  return { head, body, director };
}

/** @param resting the rows of its poses where the head is at rest */
async function makeHead(
  files: BundleFiles,
  info: HeadInfo,
  stage: Stage,
  resting: readonly number[],
  carrier: Carrier,
): Promise<Head> {
  const given = await files.head(info);
  const head = new Head(given, carrier);
  stage.add(head);
  stage.face(given, resting);
  return head;
}

/** From the first to the last row of a head's poses. */
function rows(first: number, last: number): number[] {
  return Array.from({ length: last - first + 1 }, (_, i) => first + i);
}

/** A body whose windows come from the server as they are needed. */
function makeBody(
  files: BundleFiles,
  info: BodyInfo,
  timeline: Timeline,
  motion: Motion,
  stage: Stage,
  failed: CastPorts['failed'],
): Body {
  const load = async (index: number) => {
    const window = info.windows[index]!;
    return readBakedWindow(await files.tensors(window.file), info, window);
  };
  const body = new Body(info, timeline, motion, stage.spark, { load, failed });
  stage.add(body);
  return body;
}
