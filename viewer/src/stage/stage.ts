import { SparkRenderer } from '@sparkjsdev/spark';
import * as THREE from 'three';
import type { Bundle } from '../bundle/load.ts';
import { HeadGenerator } from '../head/generator.ts';
import { PoseLoop } from '../head/poses.ts';
import { Orbit } from './orbit.ts';

export const TICK = 1 / 30; // s between changes of the face
const LEAST_ALPHA = 1 / 255; // a splat ends where its alpha falls under this
const LONGEST_STEP = 0.25; // s the head may move at once, e.g. after the page was hidden

/** What the stage shows, decided anew each tick. */
export interface Director {
  /** Writes the expression (B,) to show now; returns false if it is as before. */
  expression(out: Float32Array): boolean;
}

/** Canvas, camera and head: draws what changed and nothing else. */
export class Stage {
  readonly renderer: THREE.WebGLRenderer;
  readonly scene = new THREE.Scene();
  readonly spark: SparkRenderer;
  readonly head: HeadGenerator;
  readonly orbit: Orbit;
  readonly expression: Float32Array;
  frames = 0; // drawn so far
  moving: boolean; // the head follows the captured motion
  bodyTime = 0; // s along the captured motion
  private readonly poses: PoseLoop;
  private readonly canvas: HTMLCanvasElement;
  private director: Director | null = null;
  private lastTick = 0;
  private dirty = true;

  constructor(canvas: HTMLCanvasElement, bundle: Bundle, moving: boolean) {
    const { manifest, head, poses } = bundle;
    this.canvas = canvas;
    this.moving = moving;
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: false, powerPreference: 'high-performance' });
    // Both sRGB: colours of the bundle are display values and are blended as they are.
    this.renderer.setClearColor(new THREE.Color().setRGB(...manifest.background, THREE.SRGBColorSpace));
    this.spark = makeSpark(this.renderer, () => (this.dirty = true));
    this.head = new HeadGenerator(head);
    this.scene.add(this.spark, this.head);
    this.poses = new PoseLoop(poses, manifest.head.fps);
    this.poses.apply(0, this.head);
    this.orbit = new Orbit(canvas, manifest.camera, () => (this.dirty = true));
    this.expression = Float32Array.from(manifest.head.idle_expression);
    this.head.express(this.expression);
    new ResizeObserver(() => this.fit()).observe(canvas);
    this.fit();
  }

  /** Starts drawing what `director` decides. */
  start(director: Director): void {
    this.director = director;
    this.renderer.setAnimationLoop((now) => this.frame(now / 1000));
  }

  /** Stops the loop and shows one still: for measurements and thumbnails. */
  async still(expression: ArrayLike<number>, poseSeconds = 0): Promise<void> {
    this.renderer.setAnimationLoop(null);
    this.poses.apply(poseSeconds, this.head);
    this.expression.set(expression);
    this.head.express(this.expression);
    this.orbit.update();
    await this.sorted(); // a sort of the picture before may still run
    await this.spark.update({ scene: this.scene, camera: this.orbit.camera });
    await this.sorted();
    this.draw();
  }

  /** Draws now; what the canvas holds may be read until the current task ends. */
  draw(): void {
    this.renderer.render(this.scene, this.orbit.camera);
    this.frames++;
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
    const step = Math.min(now - this.lastTick, LONGEST_STEP);
    // Ticks stay on their grid, or a 144-Hz screen would turn 30 Hz into 28.8.
    this.lastTick = now - this.lastTick > 2 * TICK ? now : this.lastTick + TICK;
    if (this.moving) {
      this.bodyTime += step;
      this.poses.apply(this.bodyTime, this.head);
      this.dirty = true;
    }
    if (this.director?.expression(this.expression)) {
      this.head.express(this.expression);
      this.dirty = true;
    }
  }

  private fit(): void {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (!width || !height) return;
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.renderer.setSize(width, height, false);
    this.orbit.resize(width / height);
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
    minSortIntervalMs: 50, // the head sways slowly, and each sort costs a picture drawn twice
    enableLod: false,
  });
}
