import * as THREE from 'three';
import { atEnd } from '../lifetime.ts';
import type { Painter, PainterPorts } from '../soft/contract.ts';
import { watchContext } from './context.ts';
import { Sorter } from './sorter.ts';

const POLL = 5; // ms

/** Draws with Spark, by the GPU. */
export class SparkPainter implements Painter {
  readonly renderer: THREE.WebGLRenderer;
  readonly busy = false; // the GPU waits by itself
  private readonly scene: THREE.Scene;
  private readonly background: readonly [number, number, number];
  private readonly transparent: boolean;
  private readonly ports: PainterPorts;
  private readonly ending = new AbortController();
  private current: Sorter;

  /** @param transparent what is behind the canvas is seen around the avatar */
  constructor(canvas: HTMLCanvasElement, scene: THREE.Scene, background: readonly [number, number, number], transparent: boolean, ports: PainterPorts) {
    this.scene = scene;
    this.background = background;
    this.transparent = transparent;
    this.ports = ports;
    this.renderer = new THREE.WebGLRenderer({ canvas, alpha: transparent, antialias: false, powerPreference: 'high-performance' });
    this.current = this.prepare();
    watchContext(canvas, { lost: () => this.lose(), restored: () => this.restore(), gone: () => ports.gone() }, this.ending.signal);
    atEnd(this.ending.signal, () => this.current.dispose());
  }

  /** What draws the Gaussians; another one after the WebGL context was lost. */
  get spark(): Sorter {
    return this.current;
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

  fit(width: number, height: number, ratio: number): void {
    this.renderer.setPixelRatio(ratio);
    this.renderer.setSize(width, height, false);
  }

  paint(scene: THREE.Scene, camera: THREE.PerspectiveCamera, immersed: boolean): void {
    this.current.sift();
    this.current.autoUpdate = !immersed;
    if (immersed) this.gather(scene, camera);
    this.renderer.render(scene, camera);
  }

  async settle(scene: THREE.Scene, camera: THREE.PerspectiveCamera): Promise<void> {
    await this.sorted(); // a sort of the picture before may still run
    await this.current.update({ scene, camera });
    await this.sorted();
  }

  async shown(): Promise<void> {}

  dispose(): void {
    this.ending.abort();
    this.renderer.dispose();
    this.renderer.forceContextLoss();
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
    // Both sRGB: colours of the bundle are display values and are blended as they are.
    this.renderer.setClearColor(new THREE.Color().setRGB(...this.background, THREE.SRGBColorSpace), this.transparent ? 0 : 1);
    const spark = new Sorter(this.renderer, () => this.ports.dirty());
    this.scene.add(spark);
    return spark;
  }

  /** What Spark had made of the actors is lost with the context, and so is a sort that was reading it. */
  private lose(): void {
    this.ports.lost();
    this.scene.remove(this.current);
    this.current.dispose();
  }

  /** Draws on in a new context; the renderer uploads the actors' textures again by itself. */
  private restore(): void {
    this.current = this.prepare();
    this.ports.restored();
  }
}
