import { Body } from './body/body.ts';
import { Timeline } from './body/timeline.ts';
import { readBakedWindow } from './body/window.ts';
import { loadAnimation, loadFile, loadHead } from './bundle/load.ts';
import type { BodyInfo, HeadInfo, Manifest } from './bundle/manifest.ts';
import { parseSafetensors } from './bundle/safetensors.ts';
import { Head, sway } from './head/head.ts';
import { MotionDirector, type Spoken } from './motion/director.ts';
import type { Motion } from './motion/motion.ts';
import { Playback } from './motion/playback.ts';
import { makeBackdrop } from './stage/backdrop.ts';
import { sitterOf } from './stage/sitter.ts';
import type { Stage } from './stage/stage.ts';
import { person } from './stage/subject.ts';

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
  const backdrop = await makeBackdrop(manifest, ports.loaded);
  if (backdrop) stage.add(backdrop);
  if (head && body) return makePerson(manifest, head, body, stage, calm, ports);
  if (head) return { head: await makeHead(manifest, head, stage, rows(0, calm ? 0 : head.num_poses - 1), calm ? () => 0 : sway(head), ports) };
  const timeline = new Timeline(body!);
  const playback = new Playback(timeline.duration, !calm);
  return { playback, body: makeBody(manifest, body!, timeline, playback, stage, ports) };
}

/** Head and body as one: the body's time carries the head. */
async function makePerson(
  manifest: Manifest,
  info: HeadInfo,
  bodyInfo: BodyInfo,
  stage: Stage,
  calm: boolean,
  ports: CastPorts,
): Promise<Cast> {
  const animation = await loadAnimation(manifest, bodyInfo);
  const director = new MotionDirector(animation, () => ports.heard());
  if (calm) director.hold(animation.rest.end / animation.fps);
  // Before the head: it goes where the body is in the same tick.
  const body = makeBody(manifest, bodyInfo, new Timeline(bodyInfo), director, stage, ports);
  const { start, end } = animation.rest;
  const resting = rows(calm ? end : start, end);
  const head = await makeHead(manifest, info, stage, resting, () => body.time * info.fps, ports);
  return { head, body, director };
}

/** @param resting the rows of its poses where the head is at rest */
async function makeHead(
  manifest: Manifest,
  info: HeadInfo,
  stage: Stage,
  resting: readonly number[],
  carrier: (step: number) => number,
  { loaded }: CastPorts,
): Promise<Head> {
  const files = await loadHead(manifest, info, loaded);
  const head = new Head(files, carrier);
  stage.add(head);
  stage.orbit.face(person(manifest, sitterOf(manifest, files, resting)));
  return head;
}

/** From the first to the last row of a head's poses. */
function rows(first: number, last: number): number[] {
  return Array.from({ length: last - first + 1 }, (_, i) => first + i);
}

/** A body whose windows come from the server as they are needed. */
function makeBody(
  manifest: Manifest,
  info: BodyInfo,
  timeline: Timeline,
  motion: Motion,
  stage: Stage,
  { loaded, failed }: CastPorts,
): Body {
  const load = async (index: number) => {
    const window = info.windows[index]!;
    const file = await loadFile(manifest, window.file, loaded);
    return readBakedWindow(parseSafetensors(file, window.file), info, window);
  };
  const body = new Body(info, timeline, motion, stage.spark, { load, failed });
  stage.add(body);
  return body;
}
