import { Vector3 } from 'three';
import type { Actor } from './actor.ts';
import { Body } from './body/body.ts';
import { ActingBody } from './body/skinned/acting.ts';
import { readBakedSkinned, readSkinnedRows } from './body/skinned/baked.ts';
import { SkinnedBody } from './body/skinned/body.ts';
import { Timeline } from './body/timeline.ts';
import { readBakedWindow } from './body/window.ts';
import { GESTURES, SKINNED, SKINNED_REST, type BundleFiles } from './bundle/load.ts';
import { bodyOf, type AnyBody, type BodyInfo, type HeadInfo, type Manifest, type SkinnedInfo } from './bundle/manifest.ts';
import { BodyLanguage } from './gesture/performing/body-language.ts';
import { EyeMovement } from './gesture/performing/eye-movement.ts';
import { readRepertoire } from './gesture/repertoire.ts';
import { Head, sway, type Carrier } from './head/head.ts';
import { MotionDirector, type Spoken } from './motion/director.ts';
import type { Motion } from './motion/motion.ts';
import { Playback } from './motion/playback.ts';
import type { Path } from './soft/contract.ts';
import type { Stage } from './stage/stage.ts';

/** Who is on stage: a head, a body that plays, or a whole person whose body a director moves. */
export interface Cast {
  backdrop?: Actor;
  head?: Head;
  eyes?: EyeMovement; // of a head whose eyes turn
  body?: Body; // of windows
  skinned?: SkinnedBody; // or on a skeleton
  acting?: ActingBody; // which gestures as nobody recorded
  playback?: Playback;
  director?: MotionDirector;
}

/** What the cast needs of the page around it. */
export interface CastPorts {
  /** What is heard now. */
  heard(): Spoken | null;
  /** A window could not be fetched. */
  failed(error: unknown): void;
}

/**
 * Fetches who is in the bundle and puts them on stage.
 *
 * @param calm the visitor wants little motion: only faces move
 */
export async function makeCast(manifest: Manifest, files: BundleFiles, stage: Stage, calm: boolean, ports: CastPorts): Promise<Cast> {
  const backdrop = stage.transparent ? undefined : await makeBackdrop(files, stage.painter.path);
  if (backdrop) stage.add(backdrop);
  return { backdrop, ...(await makePeople(manifest, files, stage, calm, ports)) };
}

/** Fetches the less important Gaussians of who is on stage, where they have files of their own, and shows them. */
export async function refine({ head: info, skinned: body }: Manifest, files: BundleFiles, { head, skinned }: Cast): Promise<void> {
  if (head && info!.num_rest) head.refine(await files.headRest(info!));
  if (skinned && body!.num_rest) {
    skinned.refine(readSkinnedRows(await files.tensors(SKINNED_REST), body!.num_rest, body!, SKINNED_REST));
  }
}

/** The splats behind the person, if there are some; Spark reads them where it draws, and kinds that nobody else reads. */
async function makeBackdrop(files: BundleFiles, path: Path): Promise<Actor | undefined> {
  const splats = await files.backdrop();
  if (!splats) return undefined;
  const still = path === 'soft' ? await (await import('./stage/backdrop/still.ts')).makeStillBackdrop(splats) : null;
  return still ?? (await import('./stage/backdrop/spark.ts')).makeBackdrop(splats);
}

async function makePeople(manifest: Manifest, files: BundleFiles, stage: Stage, calm: boolean, ports: CastPorts): Promise<Cast> {
  const { head } = manifest;
  const body = bodyOf(manifest);
  if (head && body) return makePerson(files, manifest, head, body, stage, calm, ports);
  if (head) return makeHead(files, head, stage, { resting: rows(0, calm ? 0 : head.num_poses - 1), turns: false }, calm ? () => 0 : sway(head), anySeed());
  const playback = new Playback((body!.frames - 1) / body!.fps, !calm);
  return { playback, ...(await makeBody(files, manifest, playback, stage, ports.failed)) };
}

/** Head and body as one: the body's time carries the head. */
async function makePerson(
  files: BundleFiles,
  manifest: Manifest,
  info: HeadInfo,
  bodyInfo: AnyBody,
  stage: Stage,
  calm: boolean,
  ports: CastPorts,
): Promise<Cast> {
  const animation = await files.animation(bodyInfo);
  const director = new MotionDirector(animation, () => ports.heard());
  if (calm) director.hold(animation.rest.end / animation.fps);
  // Before the head: it goes where the body is in the same tick.
  const body = await makeBody(files, manifest, director, stage, ports.failed);
  const { start, end } = animation.rest;
  const resting = rows(calm ? end : start, end);
  const seed = anySeed();
  const acting = body.skinned && !calm ? await makeActing(files, body.skinned, manifest, end, stage, seed, ports.heard) : null;
  const row = acting ? () => end : () => (body.body ?? body.skinned!).time * info.fps;
  const shown = await makeHead(files, info, stage, { resting, turns: acting !== null }, row, seed);
  if (acting) shown.head.motion = () => acting.headMotion();
  return { ...shown, ...body, director, ...(acting ? { acting } : {}) };
}

/** Makes a body on a skeleton gesture, where the bundle has gestures for it. */
async function makeActing(
  files: BundleFiles,
  body: SkinnedBody,
  manifest: Manifest,
  frame: number,
  stage: Stage,
  seed: number,
  heard: CastPorts['heard'],
): Promise<ActingBody | null> {
  const file = await files.gestures();
  if (!file) return null;
  const rig = body.generator.skeleton.rig;
  const repertoire = readRepertoire(file, GESTURES, manifest.skinned!.names.length);
  const language = new BodyLanguage(rig, repertoire, seed, heard);
  const acting = new ActingBody(body, language, rig, repertoire.figure, frame, () => visitorOf(stage).toArray());
  stage.add(acting);
  return acting;
}

/** How a head is held. */
interface Posture {
  resting: readonly number[]; // rows of its poses where it is at rest
  turns: boolean; // to the visitor
}

/** @param seed whole number, the same as that of the body's language */
async function makeHead(
  files: BundleFiles,
  info: HeadInfo,
  stage: Stage,
  { resting, turns }: Posture,
  carrier: Carrier,
  seed: number,
): Promise<{ head: Head; eyes?: EyeMovement }> {
  const given = await files.head(info);
  const head = new Head(given, carrier);
  const eyes = info.gaze ? new EyeMovement(info.gaze, () => visitorOf(stage), seed) : undefined;
  if (eyes) head.eyes = eyes;
  stage.add(head);
  stage.face(given, resting, turns);
  return { head, eyes };
}

/** Where the visitor's eyes are, m in the world. */
function visitorOf({ camera }: Stage): Vector3 {
  return camera.getWorldPosition(new Vector3());
}

function anySeed(): number {
  return Math.floor(2 ** 32 * Math.random());
}

/** From the first to the last row of a head's poses. */
function rows(first: number, last: number): number[] {
  return Array.from({ length: last - first + 1 }, (_, i) => first + i);
}

/** The body of the bundle: of windows, or on a skeleton. */
async function makeBody(
  files: BundleFiles,
  { body, skinned }: Manifest,
  motion: Motion,
  stage: Stage,
  failed: CastPorts['failed'],
): Promise<Pick<Cast, 'body' | 'skinned'>> {
  if (skinned) return { skinned: await makeSkinned(files, skinned, motion, stage) };
  return { body: makeWindows(files, body!, motion, stage, failed) };
}

async function makeSkinned(files: BundleFiles, info: SkinnedInfo, motion: Motion, stage: Stage): Promise<SkinnedBody> {
  const skinned = new SkinnedBody(readBakedSkinned(await files.tensors(SKINNED), info, SKINNED), motion);
  stage.add(skinned);
  return skinned;
}

/** A body whose windows come from the server as they are needed. */
function makeWindows(
  files: BundleFiles,
  info: BodyInfo,
  motion: Motion,
  stage: Stage,
  failed: CastPorts['failed'],
): Body {
  const load = async (index: number) => {
    const window = info.windows[index]!;
    return readBakedWindow(await files.tensors(window.file), info, window);
  };
  const body = new Body(info, new Timeline(info), motion, stage, { load, failed });
  stage.add(body);
  return body;
}
