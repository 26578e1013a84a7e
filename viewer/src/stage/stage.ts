import * as THREE from 'three';
import type { Actor } from '../actor.ts';
import type { HeadFiles } from '../bundle/load.ts';
import { eyesOf } from '../head/eyes.ts';
import { bodyOf, type Manifest } from '../bundle/manifest.ts';
import { atEnd } from '../lifetime.ts';
import { watchContext } from './context.ts';
import { Mean, type Figures } from './figures.ts';
import { meetingOf, meetingOfBody, type Meeting } from './camera/meeting.ts';
import { Orbit } from './camera/orbit.ts';
import type { Presentation } from './presentation.ts';
import { ladder, Quality } from './quality.ts';
import { Scenery } from './scenery.ts';
import { watchSight } from './sight.ts';
import { sitterOf } from './camera/sitter.ts';
import { CurrentSorter, Sorter } from './sorter.ts';
import { groundOf, person, wholeBody } from './camera/subject.ts';

const MOST_PIXELS = 2; // along a side, for one of the page
const LEAST_FREE = 0.4; // of the height: what covers more lies over the face

/** Canvas, camera and actors: draws what changed and nothing else, and nothing while nobody can see it. */
export class Stage {
  readonly renderer: THREE.WebGLRenderer;
  readonly scene = new THREE.Scene();
  readonly orbit: Orbit;
  readonly transparent: boolean;
  /** Enters VR or AR; null where nobody offers it. */
  enterXr: (() => Promise<void>) | null = null;
  readonly scenery: Scenery;
  /** Who is met by those who come in; null before there is anybody. */
  meeting: Meeting | null = null;
  frames = 0; // drawn so far
  bytes = 0; // of the bundle that came before there was somebody to see
  /** Called when the browser takes the picture away and does not give it back. */
  onGone: () => void = () => {};
  /** When Spark sorted last, whichever renderer that was. */
  readonly sorter = new CurrentSorter(this);
  private readonly quality = new Quality(ladder({ backdrop: false, gaussians: false }));
  private covered = 0; // pixels at the lower edge that controls lie on
  private readonly canvas: HTMLCanvasElement;
  private readonly manifest: Manifest;
  private readonly actors: Actor[] = [];
  private lastFrame = 0; // s, 0 after a rest
  private dirty = true;
  private size: readonly [number, number] | null = null; // of pictures, else the canvas's own
  private drew = false; // in the last frame
  private presentation: Presentation | null = null; // instead of the page
  private readonly evaluation = new Mean(); // ms
  private readonly drawing = new Mean(); // ms
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
    this.scenery = new Scenery(manifest.background);
    const body = groundOf(manifest);
    if (body) this.meeting = meetingOfBody(body.ground, body.height);
    this.arrange();
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
    this.arrange();
    this.quality.reset(ladder({
      backdrop: this.actors.some(({ thin }) => thin),
      gaussians: this.actors.some(({ limit }) => limit),
    }));
  }

  /** What drawing takes now. */
  get figures(): Figures {
    const { domElement } = this.renderer;
    return {
      frames: this.frames,
      evaluation: this.evaluation.value,
      sort: this.spark.sortTook,
      draw: this.drawing.value,
      gaussians: this.spark.activeSplats,
      level: this.quality.index + 1,
      levels: this.quality.count,
      pixels: [domElement.width, domElement.height],
      bytes: this.bytes,
    };
  }

  /** Keeps to a level of quality whatever it costs. */
  holdQuality(index: number): void {
    const before = this.quality.index;
    this.quality.hold(index);
    if (index !== before) this.applyQuality();
  }

  /** Draws as much of everything as the level of quality says. */
  private applyQuality(): void {
    const { backdrop, gaussians } = this.quality.level;
    for (const actor of this.actors) {
      actor.limit?.(gaussians);
      actor.thin?.(backdrop);
    }
    this.fit();
  }

  /** Points the camera at somebody whose head rests at these rows of its poses. */
  face(head: HeadFiles, resting: readonly number[]): void {
    const local = new THREE.Vector3(...eyesOf(head.baked, head.info));
    const sitter = sitterOf(this.manifest, head, resting, local);
    this.orbit.face(person(this.manifest, sitter));
    this.meeting = meetingOf(sitter, local, Boolean(bodyOf(this.manifest)));
    this.arrange();
  }

  /** What the visitor looks with. */
  get camera(): THREE.PerspectiveCamera {
    return this.presentation?.camera ?? this.orbit.camera;
  }

  /** Is seen in a headset from now on, or on the page again. */
  present(presentation: Presentation | null): void {
    this.presentation = presentation;
    this.quality.aim(presentation?.rate);
    this.arrange();
    this.loop();
    this.fit();
  }

  /** Puts up what is around people: a room, or in somebody's own room their shadow alone. */
  private arrange(): void {
    const { presentation, scenery, meeting } = this;
    const through = presentation?.passthrough ?? false;
    const rooms = this.actors.filter(({ thin }) => thin);
    for (const object of rooms.flatMap(({ objects }) => objects)) object.visible = !through;
    scenery.setShadowAlone(through);
    const place = presentation ?? (meeting?.stands ? meeting : null);
    scenery.visible = place !== null;
    if (place) scenery.stand(place.ground, place.stands);
    const shown = presentation ? through || rooms.length === 0 : !this.transparent && rooms.length === 0;
    if (shown) this.scene.add(scenery);
    else scenery.removeFromParent();
  }

  /** Shows a bright room, or a dark one. */
  setBright(bright: boolean): void {
    this.scenery.setBright(bright);
    this.dirty = true;
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

  /** Draws pictures of a size in pixels, or of the canvas's own again. */
  drawAt(size: readonly [number, number] | null): void {
    this.size = size;
    this.fit();
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
    this.scenery.dispose();
    this.renderer.dispose();
    this.renderer.forceContextLoss();
  }

  /** Stops the loop and draws one still, well sorted, of the best quality, which stays: for measurements and thumbnails. */
  async still(): Promise<void> {
    this.running = false;
    this.loop();
    this.holdQuality(0);
    this.orbit.update();
    await this.sorted(); // a sort of the picture before may still run
    await this.spark.update({ scene: this.scene, camera: this.orbit.camera });
    await this.sorted();
    this.draw();
  }

  /** Draws now; what the canvas holds may be read until the current task ends. */
  draw(): void {
    for (const actor of this.actors) actor.drawing?.(performance.now());
    this.current.sift();
    const before = performance.now();
    this.spark.autoUpdate = !this.presentation;
    if (this.presentation) this.gather();
    this.renderer.render(this.scene, this.camera);
    this.drawing.add(performance.now() - before);
    this.frames++;
  }

  /** In headsets Spark would take what people look like after the picture, for the next one: late by one. */
  private gather(): void {
    this.scene.updateMatrixWorld();
    void this.spark.update({ scene: this.scene, camera: this.camera });
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
    const { xr } = this.renderer;
    const runs = this.running && (this.seen || xr.isPresenting) && !this.renderer.getContext().isContextLost();
    this.lastFrame = 0;
    this.quality.rest();
    this.dirty = true;
    const frame = runs ? (now: number) => this.frame(now / 1000) : null;
    if (xr.isPresenting) xr.setAnimationLoop(frame); // the page's own would run beside it
    else this.renderer.setAnimationLoop(frame);
  }

  /**
   * One refresh of the screen. Everybody is evaluated for this very picture: that costs less than the
   * drawing by far (`docs/benchmarks.md`), and lips are where the sound is.
   */
  private frame(now: number): void {
    const step = this.lastFrame && now - this.lastFrame;
    this.lastFrame = now;
    if (step && this.drew && this.quality.picture(step)) this.applyQuality();
    this.presentation?.frame(step, this.quality.level.pixels);
    this.advance(step);
    if (this.presentation || this.orbit.update(step)) this.dirty = true; // a headset wants each picture
    this.drew = this.dirty;
    if (!this.dirty) return;
    this.dirty = false;
    this.draw();
  }

  /** Everybody goes on by some seconds. */
  advance(step: number): void {
    const before = performance.now();
    for (const actor of this.actors) if (actor.tick(step)) this.dirty = true;
    this.evaluation.add(performance.now() - before);
  }

  private fit(): void {
    const { clientWidth, clientHeight } = this.canvas;
    const [width, height] = this.size ?? [clientWidth, clientHeight];
    if (!width || !height || this.renderer.xr.isPresenting) return;
    const ratio = this.size ? 1 : Math.min(devicePixelRatio, MOST_PIXELS) * this.quality.level.pixels;
    this.renderer.setPixelRatio(ratio);
    this.renderer.setSize(width, height, false);
    this.orbit.fit({ aspect: width / height, free: Math.max(LEAST_FREE, 1 - this.covered / (clientHeight || height)) });
    this.dirty = true;
  }
}
