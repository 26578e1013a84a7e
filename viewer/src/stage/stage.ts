import * as THREE from 'three';
import type { Actor } from '../actor.ts';
import type { HeadFiles } from '../bundle/load.ts';
import type { Manifest } from '../bundle/manifest.ts';
import { atEnd } from '../lifetime.ts';
import { watchContext } from './context.ts';
import { Orbit } from './orbit.ts';
import { watchSight } from './sight.ts';
import { sitterOf } from './sitter.ts';
import { CurrentSorter, Sorter } from './sorter.ts';
import { person, wholeBody } from './subject.ts';

export const TICK = 1 / 30; // s between changes
const LEAST_FREE = 0.4; // of the height: what covers more lies over the face

/** Canvas, camera and actors: draws what changed and nothing else, and nothing while nobody can see it. */
export class Stage {
  readonly renderer: THREE.WebGLRenderer;
  readonly scene = new THREE.Scene();
  readonly orbit: Orbit;
  readonly transparent: boolean;
  /** Enters VR or AR; null where nobody offers it. */
  enterXr: (() => Promise<void>) | null = null;
  frames = 0; // drawn so far
  /** Called when the browser takes the picture away and does not give it back. */
  onGone: () => void = () => {};
  /** When Spark sorted last, whichever renderer that was. */
  readonly sorter = new CurrentSorter(this);
  private covered = 0; // pixels at the lower edge that controls lie on
  private readonly canvas: HTMLCanvasElement;
  private readonly manifest: Manifest;
  private readonly actors: Actor[] = [];
  private lastTick = 0; // s, on the grid of ticks
  private lastTime = 0; // s, when it really was; 0 after a rest
  private lastFrame = 0; // s, 0 after a rest
  private dirty = true;
  private running = false; // between `start` and `still`
  private seen = true;
  private current: Sorter;
  private readonly ending = new AbortController();

  /** @param transparent what is behind the canvas is seen around the avatar */
  constructor(canvas: HTMLCanvasElement, manifest: Manifest, transparent = false) {
    this.canvas = canvas;
    this.manifest = manifest;
    this.transparent = transparent;
    this.renderer = new THREE.WebGLRenderer({ canvas, alpha: transparent, antialias: false, powerPreference: 'high-performance' });
    this.current = this.prepare();
    this.orbit = new Orbit(canvas, wholeBody(manifest), () => (this.dirty = true));
    const { signal } = this.ending;
    const ports = { lost: () => this.lose(), restored: () => this.restore(), gone: () => this.onGone() };
    watchContext(canvas, ports, signal);
    watchSight(canvas, (seen) => this.see(seen), signal);
    const observer = new ResizeObserver(() => this.fit());
    observer.observe(canvas);
    atEnd(signal, () => observer.disconnect());
    this.fit();
  }

  /** What draws the Gaussians; another one after the WebGL context was lost. */
  get spark(): Sorter {
    return this.current;
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
    this.running = true;
    this.loop();
  }

  /** Stops drawing for ever and gives back what the GPU holds; the canvas is of no use any more. */
  dispose(): void {
    this.running = false;
    this.loop();
    this.ending.abort();
    this.orbit.dispose();
    this.current.dispose();
    this.renderer.dispose();
    this.renderer.forceContextLoss();
  }

  /** Stops the loop and draws one still, well sorted: for measurements and thumbnails. */
  async still(): Promise<void> {
    this.running = false;
    this.loop();
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

  private async sorted(): Promise<void> {
    while (this.spark.sorting || this.spark.sortDirty) await new Promise((resolve) => setTimeout(resolve, 5));
  }

  /** Colours and Spark, for a context that is new. */
  private prepare(): Sorter {
    // Both sRGB: colours of the bundle are display values and are blended as they are.
    const background = new THREE.Color().setRGB(...this.manifest.background, THREE.SRGBColorSpace);
    this.renderer.setClearColor(background, this.transparent ? 0 : 1);
    const spark = new Sorter(this.renderer, () => (this.dirty = true));
    this.scene.add(spark);
    return spark;
  }

  /** What Spark had made of the actors is lost with the context, and so is a sort that was reading it. */
  private lose(): void {
    this.loop();
    this.scene.remove(this.current);
    this.current.dispose();
  }

  /** Draws on in a new context; the renderer uploads the actors' textures again by itself. */
  private restore(): void {
    this.current = this.prepare();
    this.fit();
    this.loop();
  }

  private see(seen: boolean): void {
    if (seen === this.seen) return;
    this.seen = seen;
    this.loop();
  }

  /** Runs or rests; time that nobody saw did not pass. */
  private loop(): void {
    const runs = this.running && this.seen && !this.renderer.getContext().isContextLost();
    this.lastTime = this.lastFrame = 0;
    this.dirty = true;
    this.renderer.setAnimationLoop(runs ? (now) => this.frame(now / 1000) : null);
  }

  private frame(now: number): void {
    const step = this.lastFrame && now - this.lastFrame;
    this.lastFrame = now;
    if (now - this.lastTick >= TICK * 0.98) this.tick(now); // 0.98: a 60-Hz screen jitters
    if (this.orbit.update(step)) this.dirty = true;
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
