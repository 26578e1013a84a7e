import { Player } from '../audio/player.ts';
import { BundleFiles, loadManifest } from '../bundle/load.ts';
import { blinkIndices, nameOf, type HeadInfo, type Manifest } from '../bundle/manifest.ts';
import { makeCast, refine, type Cast } from '../cast.ts';
import { PageError } from '../errors.ts';
import { Face } from '../face/face.ts';
import { IdleFace } from '../face/idle.ts';
import { EXPRESSION_FPS, SPEECH_RATE } from '../protocol.ts';
import { PAINTERS } from '../painters/paths.ts';
import { choosePath } from '../stage/choosing.ts';
import { Stage } from '../stage/stage.ts';

/** How an avatar is mounted. */
export interface MountOptions {
  /** Address of the bundle's folder, with `manifest.json` in it. */
  bundle: string | URL;
  /** What is behind the element is seen around the avatar. */
  transparent?: boolean;
  /** What draws: `webgl`, `soft` (the processor), or by default whichever is faster in this browser. */
  draw?: 'auto' | 'webgl' | 'soft';
  /** Little motion: only the face moves. */
  calm?: boolean;
}

/** Sound with its face. */
export interface Piece {
  /** PCM16 mono at 24,000 Hz. */
  pcm: Int16Array;
  /** Expressions at 25 per second, one row after another; the first row of a feed belongs to its first sample. */
  face: Float32Array;
}

/** A pose of a body on a skeleton. */
export interface Pose {
  /** Local rotation of each joint: unit quaternions (w, x, y, z). */
  rotations: [number, number, number, number][];
  /** Translation of the root from rest, metres. */
  root: [number, number, number];
}

/** An avatar that shows what it is given. */
export interface AvatarHandle {
  /** Numbers in an expression; 0 without a head. */
  readonly expressionSize: number;
  /** Keeps an expression; null for the living face, which blinks and speaks what is fed. */
  express(expression: ArrayLike<number> | null): void;
  /** Plays sound, right behind what was fed before, and moves the face with it; needs a click on the page before. */
  feed(piece: Piece): void;
  /** The sentence is over: what is fed next begins anew. */
  end(): void;
  /** Silences what was fed. */
  stop(): void;
  /** Makes a gesture of a body on a skeleton; false if it has none of that name. */
  gesture(name: string): boolean;
  /** Keeps a pose of a body on a skeleton; null to let it move again. */
  pose(pose: Pose | null): void;
  dispose(): void;
}

/** Shows the avatar of a bundle in an element. */
export async function mount(element: HTMLElement, { bundle, transparent = false, draw = 'auto', calm = false }: MountOptions): Promise<AvatarHandle> {
  const folder = new URL(String(bundle).replace(/\/?$/, '/'), document.baseURI);
  const locate = (name: string, sha256?: string) => new URL(sha256 ? `${name}?sha256=${sha256}` : name, folder).href;
  const manifest = await loadManifest(locate);
  const canvas = makeCanvas(nameOf(manifest));
  element.append(canvas);
  const { path, why } = choosePath(draw);
  const stage = new Stage(canvas, manifest, { make: await PAINTERS[path](), why }, transparent);
  const player = manifest.head ? new Player() : null;
  const mounted = new Mounted(stage, canvas, manifest.head ?? null, player);
  try {
    await mounted.enter(new BundleFiles(locate, manifest.files, undefined, mounted.signal), manifest, calm);
  } catch (error) {
    mounted.dispose();
    throw error;
  }
  return mounted;
}

class Mounted implements AvatarHandle {
  readonly expressionSize: number;
  private readonly stage: Stage;
  private readonly canvas: HTMLCanvasElement;
  private readonly info: HeadInfo | null;
  private readonly player: Player | null;
  private readonly ending = new AbortController();
  private cast: Cast = {};
  private living: Face | null = null;
  private utterance = 0;
  private samples = 0; // of the utterance, so far

  constructor(stage: Stage, canvas: HTMLCanvasElement, info: HeadInfo | null, player: Player | null) {
    this.stage = stage;
    this.canvas = canvas;
    this.info = info;
    this.player = player;
    this.expressionSize = info?.expression_size ?? 0;
  }

  get signal(): AbortSignal {
    return this.ending.signal;
  }

  async enter(files: BundleFiles, manifest: Manifest, calm: boolean): Promise<void> {
    const heard = () => this.player?.heard() ?? null;
    const failed = (error: unknown) => this.signal.aborted || console.error(error);
    this.cast = await makeCast(manifest, files, this.stage, calm, { heard, failed });
    if (this.info) {
      const idle = new IdleFace(Float32Array.from(this.info.idle_expression), blinkIndices(this.info));
      this.living = new Face(this.expressionSize, idle, heard);
    }
    this.express(null);
    this.stage.start();
    await this.cast.body?.ready();
    void refine(manifest, files, this.cast).catch(failed);
  }

  express(expression: ArrayLike<number> | null): void {
    const { head } = this.cast;
    if (!head) return;
    head.director = expression ? null : this.living;
    if (!expression) return;
    if (expression.length !== this.expressionSize) throw new PageError(`An expression of this avatar has ${this.expressionSize} numbers.`);
    head.express(expression);
    this.stage.invalidate();
  }

  feed({ pcm, face }: Piece): void {
    const { player, expressionSize: columns, utterance, samples: first_sample } = this;
    if (!player) throw new PageError('This avatar has no head that could speak.');
    if (face.length % columns !== 0) throw new PageError(`Each row of a face has ${columns} numbers.`);
    void player.context.resume();
    const first_expression = Math.round((first_sample / SPEECH_RATE) * EXPRESSION_FPS);
    const expressions = { rows: face.length / columns, columns, values: face };
    player.play({ utterance, first_sample, first_expression, pcm, expressions });
    this.samples += pcm.length;
  }

  end(): void {
    this.player?.end(this.utterance, this.samples);
    this.next();
  }

  stop(): void {
    this.player?.stop(this.utterance);
    this.next();
  }

  gesture(name: string): boolean {
    return this.cast.acting?.language.make(name) ?? false;
  }

  pose(pose: Pose | null): void {
    const { acting, skinned } = this.cast;
    const joints = skinned?.generator.skeleton.rig.joints.length;
    if (pose && joints !== undefined && pose.rotations.length !== joints) throw new PageError(`A pose of this body has ${joints} joints.`);
    if (acting) acting.held = pose;
    else if (pose) skinned?.strike(pose.rotations.flat(), pose.root);
    else skinned?.release();
    this.stage.invalidate();
  }

  dispose(): void {
    if (this.signal.aborted) return;
    this.ending.abort();
    this.stage.dispose();
    void this.player?.context.close();
    this.canvas.remove();
  }

  private next(): void {
    this.utterance++;
    this.samples = 0;
  }
}

function makeCanvas(label: string): HTMLCanvasElement {
  const canvas = document.createElement('canvas');
  canvas.tabIndex = 0;
  canvas.style.cssText = 'display: block; width: 100%; height: 100%; touch-action: none';
  canvas.setAttribute('role', 'img');
  canvas.setAttribute('aria-label', label);
  return canvas;
}
