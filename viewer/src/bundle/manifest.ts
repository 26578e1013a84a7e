import { PageError } from '../errors.ts';
import {
  BUNDLE_FORMAT,
  BUNDLE_VERSION,
  LID_NAMES,
  LIDS,
  MAX_CASTERS,
  MAX_CLUSTERS,
  MAX_GAUSSIANS,
  MAX_JOINTS,
  MAX_SHAPES,
  MOST,
  OLDEST_BUNDLE,
  SMALLER,
} from '../shared.ts';
import { badText, type Persona, type Provenance } from './texts.ts';

/** Where the visitor starts, world space. */
export interface StartCamera {
  eye: [number, number, number];
  target: [number, number, number];
  up: [number, number, number];
  fov_y: number; // degrees
}

/** How the eyes of a head turn: by the last two displacements of its Gaussians. */
export interface GazeInfo {
  eyes: [number, number, number]; // between the centres of the eyeballs, m in canonical head space
  most: [number, number]; // radians to either side, and up or down
}

/** The counts of a head. */
export interface HeadInfo {
  num_gaussians: number;
  rank: number;
  hidden: number;
  inputs: 'speech' | 'blendshapes';
  expression_size: number;
  eye_offset: number | null;
  expression_names: string[];
  fps: number;
  num_poses: number;
  idle_expression: number[];
  num_rest: number; // of the Gaussians, in a file of their own
  num_displacements: number; // ways in which Gaussians move with the expression, and with the gaze
  gaze: GazeInfo | null; // null where eyes do not turn
}

/** A span of the body's frames, both ends inside, with Gaussians of its own. */
export interface WindowInfo {
  first: number;
  last: number;
  num_gaussians: number;
  num_clusters: number; // groups of Gaussians that move in ways of their own
  ranks: [number, number, number]; // of positions, rotations, scales
  file: string;
}

/** The body's times and counts; windows without gaps, in the order of time. */
export interface BodyInfo {
  fps: number;
  samples_per_frame: number;
  low: [number, number, number]; // bounds of what is seen at any time, world space
  high: [number, number, number];
  windows: WindowInfo[];
}

/** Counts and rig of a body on a skeleton. */
export interface SkinnedInfo {
  fps: number; // of the recorded poses
  num_frames: number;
  num_gaussians: number;
  num_shapes: number;
  num_moving: number; // joints that turn in the recording
  num_known: number; // recorded poses that tell the coefficients of any other pose
  names: string[]; // of joints
  parents: number[]; // before their children, -1 for the root
  low: [number, number, number]; // bounds of what is seen at any time, world space
  high: [number, number, number];
  num_casters: number; // spheres that cast shadows; 0 without a lamp
  num_rest: number; // of the Gaussians, in a file of their own
}

/** What the page reads of `manifest.json`; `docs/bundle.md` describes it whole. */
export interface Manifest {
  name: string;
  files: Record<string, { sha256: string; size: number }>;
  head: HeadInfo | null;
  body: BodyInfo | null; // of windows
  skinned: SkinnedInfo | null; // or on a skeleton
  camera: StartCamera;
  background: [number, number, number];
  persona: Persona;
  provenance: Provenance;
}

/**
 * Checks a parsed manifest as far as the page relies on it.
 *
 * @throws PageError naming the first thing that is wrong
 */
export function checkManifest(value: unknown): Manifest {
  const manifest = value as Manifest & { format?: string; version?: number };
  if (manifest?.format !== BUNDLE_FORMAT) throw new PageError('manifest.json is not that of an avatar bundle.');
  if (!(manifest.version! >= OLDEST_BUNDLE && manifest.version! <= BUNDLE_VERSION)) {
    throw new PageError(`This avatar has format version ${manifest.version}; the page reads up to ${BUNDLE_VERSION}.`);
  }
  const { camera, background } = manifest;
  checkFiles(manifest.files);
  const body = manifest.body ?? null; // older manifests do not know of it
  const head = manifest.head && withHeadDefaults(manifest.head);
  const skinned = manifest.skinned ? withDefaults(manifest.skinned) : null;
  if (!head && !body && !skinned) bad('head');
  if (body && skinned) bad('skinned');
  if (head) checkHead(head);
  if (body) checkBody(body);
  if (skinned) checkSkinned(skinned);
  if (head && body) checkTogether(head, body.fps, framesOf(body));
  if (head && skinned) checkTogether(head, skinned.fps, skinned.num_frames);
  for (const key of ['eye', 'target', 'up'] as const) if (!isNumbers(camera?.[key], 3)) bad(`camera.${key}`);
  if (!(camera.fov_y > 0 && camera.fov_y < 180)) bad('camera.fov_y');
  if (!isNumbers(background, 3)) bad('background');
  const text = badText(manifest);
  if (text) bad(text);
  return { ...manifest, head, body, skinned };
}

/** Room is made for files before they come, which may be packed on the way. */
function checkFiles(files: Manifest['files']): void {
  const listed = Object.entries(files ?? bad('files'));
  for (const [name, file] of listed) {
    const most = (SMALLER as Record<string, number>)[name] ?? MOST.file_bytes;
    if (file?.size !== 0 && !isCount(file?.size, most)) bad(`files.${name}`);
  }
  const together = listed.reduce((sum, [, file]) => sum + file.size, 0);
  if (listed.length > MOST.files || together > MOST.bundle_bytes) bad('files');
}

/** Texts go onto the page. */
/** Whether the avatar is nobody's likeness. */
export function isSynthetic({ kind }: { kind: string }): boolean {
  return kind === 'synthetic';
}

function withHeadDefaults(info: HeadInfo): HeadInfo {
  return { ...info, num_rest: info.num_rest ?? 0, num_displacements: info.num_displacements ?? 0, gaze: info.gaze ?? null };
}

function withDefaults(info: SkinnedInfo): SkinnedInfo {
  return { ...info, num_casters: info.num_casters ?? 0, num_rest: info.num_rest ?? 0 };
}

/** Whether so many of all Gaussians may lie in a file of their own. */
function isRest(rest: number, all: number): boolean {
  return Number.isInteger(rest) && rest >= 0 && rest < all;
}

function checkHead(head: HeadInfo): void {
  for (const key of ['rank', 'hidden', 'expression_size', 'num_poses'] as const) {
    if (!isCount(head[key], MOST[key])) bad(`head.${key}`);
  }
  if (!isCount(head.num_gaussians, MAX_GAUSSIANS)) bad('head.num_gaussians'); // room is made for all before the last ones come
  if (!isRate(head.fps)) bad('head.fps');
  if (!isRest(head.num_rest, head.num_gaussians)) bad('head.num_rest');
  if (head.num_displacements !== 0 && !isCount(head.num_displacements, MOST.displacements)) bad('head.num_displacements');
  if (head.num_gaussians * (head.rank + head.num_displacements) > MOST.blended) bad('head.rank');
  if (!isNumbers(head.idle_expression, head.expression_size)) bad('head.idle_expression');
  if (head.gaze) checkGaze(head.gaze, head.num_displacements);
}

function checkGaze({ eyes, most }: GazeInfo, displacements: number): void {
  if (!isNumbers(eyes, 3) || eyes.some((value) => Math.abs(value) > 1)) bad('head.gaze.eyes');
  if (!isNumbers(most, 2) || most.some((value) => value <= 0 || value > MOST.eye_turn)) bad('head.gaze.most');
  if (displacements < 2) bad('head.num_displacements');
}

function checkBody(body: BodyInfo): void {
  if (!isRate(body.fps)) bad('body.fps');
  if (!isCount(body.samples_per_frame, MOST.samples_per_frame)) bad('body.samples_per_frame');
  for (const key of ['low', 'high'] as const) if (!isNumbers(body[key], 3)) bad(`body.${key}`);
  if (!Array.isArray(body.windows) || body.windows.length === 0) bad('body.windows');
  body.windows.forEach((window, i) => {
    const { first, last, ranks } = window;
    if (window.file !== windowFile(i)) bad(`body.windows[${i}].file`); // else any address could be asked for
    const begins = i ? body.windows[i - 1]!.last : 0;
    if (first !== begins || !isCount(last - first, MOST.window_frames)) bad(`body.windows[${i}]`);
    if (!isCount(window.num_gaussians, MAX_GAUSSIANS)) bad(`body.windows[${i}].num_gaussians`);
    if (!isCount(window.num_clusters, MAX_CLUSTERS)) bad(`body.windows[${i}].num_clusters`);
    if (!isNumbers(ranks, 3) || !ranks.every((rank) => isCount(rank, MOST.body_rank))) bad(`body.windows[${i}].ranks`);
    const times = body.samples_per_frame * (last - first) + 1;
    if (times * window.num_clusters * (ranks[0] + ranks[1] + ranks[2]) > MOST.moved) bad(`body.windows[${i}].num_clusters`);
  });
  const { count, ranks } = roomFor(body);
  if (count * (1 + ranks[0] + ranks[1] + ranks[2]) > MOST.moved) bad('body.windows');
}

/** What a place must hold in which every window of a body takes its turn. */
export function roomFor({ windows }: BodyInfo): { count: number; clusters: number; ranks: [number, number, number] } {
  const most = (value: (window: WindowInfo) => number) => windows.reduce((all, window) => Math.max(all, value(window)), 0);
  return {
    count: most((window) => window.num_gaussians),
    clusters: most((window) => window.num_clusters),
    ranks: [most(({ ranks }) => ranks[0]), most(({ ranks }) => ranks[1]), most(({ ranks }) => ranks[2])],
  };
}

/** Name of the file of a window of a body. */
function windowFile(index: number): string {
  return `body/${String(index).padStart(4, '0')}.safetensors`;
}

/** A head is carried by its body: it has a pose for each of the body's frames. */
function checkTogether(head: HeadInfo, fps: number, frames: number): void {
  if (head.fps !== fps) bad('head.fps');
  if (head.num_poses !== frames) bad('head.num_poses');
}

function checkSkinned(info: SkinnedInfo): void {
  if (!isRate(info.fps)) bad('skinned.fps');
  for (const key of ['low', 'high'] as const) if (!isNumbers(info[key], 3)) bad(`skinned.${key}`);
  const { names, parents } = info;
  if (!Array.isArray(names) || !isCount(names.length, MAX_JOINTS)) bad('skinned.names');
  const tree = isNumbers(parents, names.length) && parents.every((parent, i) => Number.isInteger(parent) && parent < i && parent >= Math.min(i - 1, 0));
  if (!tree) bad('skinned.parents');
  const most = { num_frames: MOST.posed_frames, num_gaussians: MAX_GAUSSIANS, num_shapes: MAX_SHAPES, num_moving: names.length, num_known: Math.min(info.num_frames, MOST.known_poses) };
  for (const [key, top] of Object.entries(most)) if (!isCount(info[key as keyof typeof most], top)) bad(`skinned.${key}`);
  if (info.num_frames < 2) bad('skinned.num_frames');
  if (!isRest(info.num_rest, info.num_gaussians)) bad('skinned.num_rest');
  if (info.num_casters !== 0 && !isCount(info.num_casters, MAX_CASTERS)) bad('skinned.num_casters');
}

/** Frames of a body of windows. */
function framesOf({ windows }: BodyInfo): number {
  return windows.at(-1)!.last + 1;
}

/** What is alike in bodies of both kinds. */
export interface AnyBody {
  fps: number;
  frames: number;
  low: [number, number, number];
  high: [number, number, number];
}

/** The body, of windows or on a skeleton, if there is one. */
export function bodyOf({ body, skinned }: Pick<Manifest, 'body' | 'skinned'>): AnyBody | null {
  if (body) return { fps: body.fps, frames: framesOf(body), low: body.low, high: body.high };
  return skinned && { fps: skinned.fps, frames: skinned.num_frames, low: skinned.low, high: skinned.high };
}

/** What somebody is called. */
export function nameOf({ persona, name }: Manifest): string {
  return persona.name || name;
}

function isCount(value: unknown, most: number): boolean {
  return Number.isInteger(value) && (value as number) > 0 && (value as number) <= most;
}

/** Whether it is a number of recorded frames per second. */
function isRate(value: unknown): boolean {
  return isPositive(value) && (value as number) >= 0.1 && (value as number) <= 1000;
}

function isPositive(value: unknown): boolean {
  return Number.isFinite(value) && (value as number) > 0;
}

function isNumbers(value: unknown, length: number): boolean {
  return Array.isArray(value) && value.length === length && value.every(Number.isFinite);
}

function bad(field: string): never {
  throw new PageError(`manifest.json: ${field} is missing or not what it should be.`);
}

/** Indices of the two eyelid values in the expression, or none. */
export function blinkIndices({ eye_offset, expression_names }: HeadInfo): number[] {
  if (eye_offset !== null) return LIDS.map((lid) => eye_offset + lid);
  return LID_NAMES.map((name) => expression_names.indexOf(name)).filter((index) => index >= 0);
}
