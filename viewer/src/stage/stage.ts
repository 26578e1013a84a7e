import * as THREE from 'three';
import type { Actor } from '../actor.ts';
import type { HeadFiles } from '../bundle/load.ts';
import { eyesOf } from '../head/eyes.ts';
import { bodyOf, type Manifest } from '../bundle/manifest.ts';
import { atEnd } from '../lifetime.ts';
import { PageError } from '../errors.ts';
import type { Painter } from '../soft/contract.ts';
import { Mean, type Figures } from './figures.ts';
import { meetingOf, meetingOfBody, type Meeting } from './camera/meeting.ts';
import { Orbit } from './camera/orbit.ts';
import { Painting, type Drawing } from './painting.ts';
import type { Presentation } from './presentation.ts';
import { ladder, Quality } from './quality.ts';
import { Scenery } from './scenery.ts';
import { watchSight } from './sight.ts';
import { sitterOf } from './camera/sitter.ts';
import type { Sorter } from './webgl/sorter.ts';
import type { SparkPainter } from './webgl/spark.ts';
import { groundOf, person, wholeBody } from './camera/subject.ts';

const MOST_PIXELS = 2; // along a side, for one of the page
const REST = 0.1; // s without a change after which a picture is at rest
const SPARING = 0.145; // s from picture to picture at least, where the processor that draws is needed elsewhere
const LEAST_FREE = 0.4; // of the height: what covers more lies over the face

/** Canvas, camera and actors: draws what changed and nothing else, and nothing while nobody can see it. */
export class Stage {
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
  /** Called once, when the first picture is seen. */
  onSeen: () => void = () => {};
  /** Called when the browser takes the picture away and does not give it back. */
  onGone: () => void = () => {};
  private readonly quality = new Quality(ladder({ backdrop: false, gaussians: false }));
  private covered = { all: 0, controls: 0, words: 0 }; // pixels at the lower edge, and at the upper one
  private readonly canvas: HTMLCanvasElement;
  private readonly manifest: Manifest;
  private readonly actors: Actor[] = [];
  private lastFrame = 0; // s, 0 after a rest
  private dirty = true;
  private size: readonly [number, number] | null = null; // of pictures, else the canvas's own
  private drew = false; // in the last frame
  private resting = 0; // s since something changed
  private sparing = false;
  private presentation: Presentation | null = null; // instead of the page
  private readonly evaluation = new Mean(); // ms
  private readonly drawing = new Mean(); // ms
  private running = false; // between `start` and `still`
  private seen = true;
  private readonly ending = new AbortController();
  private readonly painting: Painting;

  /**
   * @param canvas takes the pictures, and what the visitor does with them
   * @param drawing what draws
   * @param transparent what is behind the canvas is seen around the avatar
   */
  constructor(canvas: HTMLCanvasElement, manifest: Manifest, drawing: Drawing, transparent = false) {
    this.canvas = canvas;
    this.manifest = manifest;
    this.transparent = transparent;
    this.scenery = new Scenery(manifest.background);
    const ports = {
      dirty: () => this.invalidate(),
      lost: () => this.loop(),
      restored: () => {
        this.fit();
        this.loop();
      },
      gone: () => this.onGone(),
    };
    const easel = { canvas, scene: this.scene, background: manifest.background, backcloth: this.scenery, transparent };
    this.painting = new Painting(easel, ports, drawing);
    canvas.style.visibility = 'hidden'; // many browsers show black where nothing was drawn yet
    const body = groundOf(manifest);
    if (body) this.meeting = meetingOfBody(body.ground, body.height);
    this.arrange();
    this.orbit = new Orbit(canvas, wholeBody(manifest), () => (this.dirty = true));
    const { signal } = this.ending;
    watchSight(canvas, (seen) => this.see(seen), signal);
    const observer = new ResizeObserver(() => this.fit());
    observer.observe(canvas);
    atEnd(signal, () => observer.disconnect());
    this.fit();
  }

  /** What draws. */
  get painter(): Painter {
    return this.painting.painter;
  }

  /** Whether Gaussians are being sorted. */
  get sorting(): boolean {
    return this.painter.sorting;
  }

  /** When the last sort began, ms of the performance clock. */
  get lastSortTime(): number {
    return this.painter.lastSortTime;
  }

  /** What draws the Gaussians by WebGL; another one after its context was lost. */
  get spark(): Sorter {
    return this.webgl.spark;
  }

  get renderer(): THREE.WebGLRenderer {
    return this.webgl.renderer;
  }

  private get webgl(): SparkPainter {
    if (this.painter.path === 'webgl') return this.painter as SparkPainter;
    throw new PageError('This picture is drawn without WebGL.');
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
    const { painter } = this;
    return {
      drawn: this.painting.why,
      frames: this.frames,
      evaluation: this.evaluation.value,
      sort: painter.sortTook,
      draw: this.drawing.value,
      gaussians: painter.gaussians,
      level: this.quality.index + 1,
      levels: this.quality.count,
      pixels: painter.pixels,
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

  /**
   * Points the camera at somebody.
   *
   * @param resting the rows of the head's poses where it is at rest
   * @param turns whether the head turns to the visitor
   */
  face(head: HeadFiles, resting: readonly number[], turns: boolean): void {
    const local = new THREE.Vector3(...eyesOf(head.baked, head.info));
    const sitter = sitterOf(this.manifest, head, resting, turns, local);
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
    const place = presentation ?? meeting;
    scenery.visible = meeting !== null;
    if (place && meeting) scenery.stand(place.ground, meeting.eyes, place.stands);
    const shown = presentation ? through || rooms.length === 0 : !this.transparent && rooms.length === 0;
    if (shown) this.scene.add(scenery);
    else scenery.removeFromParent();
  }

  /** Shows a bright room, or a dark one. */
  setBright(bright: boolean): void {
    this.scenery.setBright(bright);
    this.dirty = true;
  }

  /**
   * Keeps faces clear of all that lies at the lower edge, and whole figures clear of the controls.
   *
   * @param all pixels that controls or captions lie on
   * @param controls pixels that controls lie on
   * @param words pixels at the upper edge that words lie on, close to the head
   */
  keepClear(all: number, controls = all, words = 0): void {
    this.covered = { all, controls, words };
    this.fit();
  }

  /** Draws anew with the next frame, though no actor says so. */
  invalidate(): void {
    this.dirty = true;
  }

  /**
   * Leaves the processor to others from now on, or takes it again: while a visitor speaks and waits for
   * an answer, whoever works it out may be on this very machine. A graphics card is nobody else's.
   */
  spare(sparing: boolean): void {
    if (sparing !== this.sparing) this.quality.rest();
    this.sparing = sparing;
  }

  /** Draws pictures of a size in pixels, or of the canvas's own again. */
  drawAt(size: readonly [number, number] | null): void {
    this.size = size;
    this.fit();
  }

  /** Something else draws from now on; the picture of before stays until it has drawn one. */
  async redraw(drawing: Drawing): Promise<void> {
    const prepare = async (painter: Painter) => {
      this.fit(painter);
      await painter.settle(this.scene, this.camera);
      this.ending.signal.throwIfAborted();
    };
    await this.painting.change(drawing, prepare, () => {
      this.quality.aim();
      this.draw();
    });
    this.fit();
    this.loop();
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
    this.scenery.dispose();
    this.painting.dispose();
  }

  /** Stops the loop and draws one still, well sorted, of the best quality, which stays: for measurements and thumbnails. */
  async still(): Promise<void> {
    this.running = false;
    this.loop();
    this.holdQuality(0);
    this.orbit.update();
    await this.painter.settle(this.scene, this.orbit.camera);
    this.draw();
    await this.painter.shown();
  }

  /** Draws now; what the canvas holds may be read until the current task ends. */
  draw(): void {
    for (const actor of this.actors) {
      actor.drawing?.(performance.now());
      if (actor.points) this.scenery.follow(actor.points);
    }
    const before = performance.now();
    this.painter.paint(this.scene, this.camera, this.presentation !== null);
    this.drawing.add(this.painter.drawTook ?? performance.now() - before);
    if (this.frames++ === 0) void this.unveil();
  }

  /** Shows the canvas with its first picture. */
  private async unveil(): Promise<void> {
    await this.painter.shown();
    this.canvas.style.visibility = '';
    this.onSeen();
  }

  private see(seen: boolean): void {
    if (seen === this.seen) return;
    this.seen = seen;
    this.loop();
  }

  /** Runs or rests; time that nobody saw did not pass. */
  private loop(): void {
    const runs = this.running && (this.seen || this.painter.presenting) && !this.painter.lost;
    this.lastFrame = 0;
    this.quality.rest();
    this.dirty = true;
    this.painter.loop(runs ? (now) => this.frame(now / 1000) : null);
  }

  /**
   * One refresh of the screen, or a picture that missed the last one. Everybody is evaluated for this very picture: that costs less than the
   * drawing by far (`docs/benchmarks.md`), and lips are where the sound is.
   */
  private frame(now: number): void {
    const spares = this.sparing && this.painter.path === 'soft';
    const step = this.lastFrame && Math.max(0, now - this.lastFrame);
    if (this.painter.busy || (spares && step && step < SPARING)) return;
    this.lastFrame = now;
    if (step && this.drew && !spares && this.quality.picture(step)) this.applyQuality();
    this.presentation?.frame(step, this.quality.level.pixels);
    this.advance(step);
    if (this.presentation || this.orbit.update(step)) this.dirty = true; // a headset wants each picture
    this.drew = this.dirty;
    this.refine(step);
    if (!this.dirty) return;
    this.dirty = false;
    this.draw();
  }

  /** Pictures at rest are as fine as can be, those that move as their level of quality says. */
  private refine(step: number): void {
    if (!this.painter.refines || this.quality.level.pixels === 1) return;
    const before = this.fine;
    this.resting = this.dirty ? 0 : this.resting + step;
    if (this.fine !== before) this.fit();
  }

  private get fine(): boolean {
    return this.resting >= REST;
  }

  /** Everybody goes on by some seconds. */
  advance(step: number): void {
    const before = performance.now();
    for (const actor of this.actors) if (actor.tick(step)) this.dirty = true;
    this.evaluation.add(performance.now() - before);
  }

  private fit(painter = this.painter): void {
    const { clientWidth, clientHeight } = this.canvas;
    const [width, height] = this.size ?? [clientWidth, clientHeight];
    if (!width || !height || painter.presenting) return;
    const ratio = this.size ? 1 : Math.min(devicePixelRatio, MOST_PIXELS);
    painter.fit(width, height, ratio, this.size || this.fine ? 1 : this.quality.level.pixels);
    const share = (pixels: number) => Math.max(LEAST_FREE, 1 - pixels / (clientHeight || height));
    const top = this.covered.words / (clientHeight || height);
    this.orbit.fit({ aspect: width / height, free: share(this.covered.all), clear: share(this.covered.controls), top });
    this.dirty = true;
  }
}
