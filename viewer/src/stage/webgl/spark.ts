import * as THREE from 'three';
import { atEnd } from '../../lifetime.ts';
import { Generator } from '../../gaussians/generator.ts';
import type { Easel, Painter, PainterPorts } from '../../soft/contract.ts';
import { nameOf } from '../../soft/graphics.ts';
import { watchContext } from './context.ts';
import { Sorter } from './sorter.ts';

const POLL = 5; // ms

/** What Spark draws of a generator; some must be read from a file before. */
export type Twin = THREE.Object3D & { initialized?: Promise<unknown> };

/** Draws with Spark, by the GPU. */
export class SparkPainter implements Painter {
  readonly path = 'webgl';
  readonly renderer: THREE.WebGLRenderer;
  readonly busy = false; // the GPU waits by itself
  readonly refines = false; // where software draws, one fine picture takes as long as all that it would follow
  private readonly easel: Easel;
  private readonly ports: PainterPorts;
  private readonly ending = new AbortController();
  private readonly makeTwin: (generator: Generator) => Twin;
  private readonly twins = new Map<Generator, Twin>();
  private current: Sorter;

  /** @param makeTwin makes what Spark draws of a generator */
  constructor(easel: Easel, ports: PainterPorts, makeTwin: (generator: Generator) => Twin) {
    const { canvas, transparent: alpha } = easel;
    this.easel = easel;
    this.ports = ports;
    this.makeTwin = makeTwin;
    this.renderer = new THREE.WebGLRenderer({ canvas, alpha, antialias: false, powerPreference: 'high-performance' });
    this.current = this.prepare();
    watchContext(canvas, { lost: () => this.lose(), restored: () => this.restore(), gone: () => ports.gone() }, this.ending.signal);
    atEnd(this.ending.signal, () => this.current.dispose());
  }

  /** What draws the Gaussians; another one after the WebGL context was lost. */
  get spark(): Sorter {
    return this.current;
  }

  get name(): string {
    return nameOf(this.renderer.getContext());
  }

  get pixels(): [number, number] {
    const { domElement } = this.renderer;
    return [domElement.width, domElement.height];
  }

  get gaussians(): number {
    return this.current.activeSplats;
  }

  get sorting(): boolean {
    return this.current.sorting;
  }

  get lastSortTime(): number {
    return this.current.lastSortTime;
  }

  readonly drawTook = null;

  get sortTook(): number {
    return this.current.sortTook;
  }

  get lost(): boolean {
    return this.renderer.getContext().isContextLost();
  }

  get presenting(): boolean {
    return this.renderer.xr.isPresenting;
  }

  loop(frame: ((now: number) => void) | null): void {
    const { xr } = this.renderer;
    if (xr.isPresenting) xr.setAnimationLoop(frame); // the page's own would run beside it
    else this.renderer.setAnimationLoop(frame);
  }

  fit(width: number, height: number, ratio: number, share: number): void {
    this.renderer.setPixelRatio(ratio * share);
    this.renderer.setSize(width, height, false);
  }

  paint(scene: THREE.Scene, camera: THREE.PerspectiveCamera, immersed: boolean): void {
    this.pair(scene);
    this.current.sift();
    this.current.autoUpdate = !immersed;
    if (immersed) this.gather(scene, camera);
    this.renderer.render(scene, camera);
  }

  async settle(scene: THREE.Scene, camera: THREE.PerspectiveCamera): Promise<void> {
    this.pair(scene);
    for (const { initialized } of this.twins.values()) await initialized;
    await this.sorted(); // a sort of the picture before may still run
    await this.current.update({ scene, camera });
    await this.sorted();
  }

  /** Waits for the GPU. */
  async shown(): Promise<void> {
    const gl = this.renderer.getContext();
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
  }

  dispose(): void {
    this.loop(null);
    this.ending.abort();
    for (const twin of this.twins.values()) twin.removeFromParent();
    this.easel.scene.remove(this.current);
    this.renderer.dispose();
    this.renderer.forceContextLoss();
  }

  /** Gives generators that are new on stage what Spark draws of them. */
  private pair(scene: THREE.Scene): void {
    for (const generator of scene.children) {
      if (!(generator instanceof Generator) || this.twins.has(generator)) continue;
      const twin = this.makeTwin(generator);
      this.twins.set(generator, twin);
      generator.add(twin);
    }
  }

  /** In headsets Spark would take what people look like after the picture, for the next one: late by one. */
  private gather(scene: THREE.Scene, camera: THREE.PerspectiveCamera): void {
    scene.updateMatrixWorld();
    void this.current.update({ scene, camera });
  }

  private async sorted(): Promise<void> {
    while (this.current.sorting || this.current.sortDirty) await new Promise((resolve) => setTimeout(resolve, POLL));
  }

  /** Colours and Spark, for a context that is new. */
  private prepare(): Sorter {
    const { background, transparent, scene } = this.easel;
    // Both sRGB: colours of the bundle are display values and are blended as they are.
    this.renderer.setClearColor(new THREE.Color().setRGB(...background, THREE.SRGBColorSpace), transparent ? 0 : 1);
    const spark = new Sorter(this.renderer, () => this.ports.dirty());
    scene.add(spark);
    return spark;
  }

  /** What Spark had made of the actors is lost with the context, and so is a sort that was reading it. */
  private lose(): void {
    this.ports.lost();
    this.easel.scene.remove(this.current);
    this.current.dispose();
  }

  /** Draws on in a new context; the renderer uploads the actors' textures again by itself. */
  private restore(): void {
    this.current = this.prepare();
    this.ports.restored();
  }
}
