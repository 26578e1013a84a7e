import { SparkRenderer } from '@sparkjsdev/spark';
import * as THREE from 'three';
import type { Actor } from '../actor.ts';
import type { HeadFiles } from '../bundle/load.ts';
import type { Manifest } from '../bundle/manifest.ts';
import { Orbit } from './orbit.ts';
import { sitterOf } from './sitter.ts';
import { person, wholeBody } from './subject.ts';

export const TICK = 1 / 30; // s between changes
const LEAST_FREE = 0.4; // of the height: what covers more lies over the face
const LEAST_ALPHA = 1 / 255; // a splat ends where its alpha falls under this

/** Canvas, camera and actors: draws what changed and nothing else. */
export class Stage {
  readonly renderer: THREE.WebGLRenderer;
  readonly scene = new THREE.Scene();
  readonly spark: SparkRenderer;
  readonly orbit: Orbit;
  readonly transparent: boolean;
  /** Enters VR or AR; null where nobody offers it. */
  enterXr: (() => Promise<void>) | null = null;
  frames = 0; // drawn so far
  private covered = 0; // pixels at the lower edge that controls lie on
  private readonly canvas: HTMLCanvasElement;
  private readonly manifest: Manifest;
  private readonly actors: Actor[] = [];
  private lastTick = 0; // s, on the grid of ticks
  private lastTime = 0; // s, when it really was
  private dirty = true;
  private readonly resizing = new ResizeObserver(() => this.fit());

  /** @param transparent what is behind the canvas is seen around the avatar */
  constructor(canvas: HTMLCanvasElement, manifest: Manifest, transparent = false) {
    this.canvas = canvas;
    this.manifest = manifest;
    this.transparent = transparent;
    this.renderer = new THREE.WebGLRenderer({ canvas, alpha: transparent, antialias: false, powerPreference: 'high-performance' });
    // Both sRGB: colours of the bundle are display values and are blended as they are.
    const background = new THREE.Color().setRGB(...manifest.background, THREE.SRGBColorSpace);
    this.renderer.setClearColor(background, transparent ? 0 : 1);
    this.spark = makeSpark(this.renderer, () => (this.dirty = true));
    this.scene.add(this.spark);
    this.orbit = new Orbit(canvas, wholeBody(manifest), () => (this.dirty = true));
    this.resizing.observe(canvas);
    this.fit();
  }

  /** Adds an actor; before the start only, or Spark would hold its picture until it has sorted anew. */
  add(actor: Actor): void {
    this.actors.push(actor);
    for (const object of actor.objects) this.scene.add(object);
  }

  /** Points the camera at somebody whose head rests at these rows of its poses. */
  face(head: HeadFiles, resting: readonly number[]): void {
    this.orbit.face(person(this.manifest, sitterOf(this.manifest, head, resting)));
  }

  /** Keeps faces clear of so many pixels at the lower edge. */
  keepClear(pixels: number): void {
    this.covered = pixels;
    this.fit();
  }

  /** Draws anew with the next frame, though no actor says so. */
  invalidate(): void {
    this.dirty = true;
  }

  /** Starts drawing what the actors do. */
  start(): void {
    this.renderer.setAnimationLoop((now) => this.frame(now / 1000));
  }

  /** Stops the loop and draws one still, well sorted: for measurements and thumbnails. */
  async still(): Promise<void> {
    this.renderer.setAnimationLoop(null);
    this.orbit.update();
    await this.sorted(); // a sort of the picture before may still run
    await this.spark.update({ scene: this.scene, camera: this.orbit.camera });
    await this.sorted();
    this.draw();
  }

  /** Draws now; what the canvas holds may be read until the current task ends. */
  draw(): void {
    for (const actor of this.actors) actor.drawing?.(performance.now());
    this.renderer.render(this.scene, this.orbit.camera);
    this.frames++;
  }

  /** Stops drawing and gives all memory of the GPU back. */
  dispose(): void {
    this.renderer.setAnimationLoop(null);
    this.resizing.disconnect();
    this.orbit.dispose();
    this.spark.dispose();
    this.renderer.dispose();
    this.renderer.forceContextLoss();
  }

  private async sorted(): Promise<void> {
    while (this.spark.sorting || this.spark.sortDirty) await new Promise((resolve) => setTimeout(resolve, 5));
  }

  private frame(now: number): void {
    if (now - this.lastTick >= TICK * 0.98) this.tick(now); // 0.98: a 60-Hz screen jitters
    if (this.orbit.update()) this.dirty = true;
    if (!this.dirty) return;
    this.dirty = false;
    this.draw();
  }

  private tick(now: number): void {
    const step = this.lastTime && now - this.lastTime;
    this.lastTime = now;
    // Ticks stay on their grid, or a 144-Hz screen would turn 30 Hz into 28.8.
    this.lastTick = now - this.lastTick > 2 * TICK ? now : this.lastTick + TICK;
    for (const actor of this.actors) if (actor.tick(step)) this.dirty = true;
  }

  private fit(): void {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (!width || !height) return;
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.renderer.setSize(width, height, false);
    this.orbit.fit({ aspect: width / height, free: Math.max(LEAST_FREE, 1 - this.covered / height) });
    this.dirty = true;
  }
}

/** Spark set to the filter that bundles are trained with (`docs/bundle.md`, rendering). */
function makeSpark(renderer: THREE.WebGLRenderer, onDirty: () => void): SparkRenderer {
  return new SparkRenderer({
    renderer,
    onDirty,
    accumExtSplats: true, // the packed kind has half-float centres: millimetre steps, visible on lips
    blurAmount: 0.3,
    preBlurAmount: 0,
    minAlpha: LEAST_ALPHA,
    maxStdDev: Math.sqrt(2 * Math.log(255)), // where an opaque splat's alpha reaches 1/255
    maxPixelRadius: 4096,
    sortRadial: false, // by depth, as in training
    minSortIntervalMs: 50, // people move little in that time, and each sort costs a picture drawn twice
    enableLod: false,
  });
}
