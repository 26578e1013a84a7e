import { Matrix4, Vector3, type Object3D, type PerspectiveCamera, type Scene } from 'three';
import type { Easel, MakePainter, Painter } from './contract.ts';
import type { Drawn, Order } from './band.ts';
import { Bands, workersFor } from './bands.ts';
import { Pulse } from './pulse.ts';
import type { Cloth, Frame, Placed, Steps } from './rasteriser.ts';
import type { SoftObject, Source } from './source.ts';
import { TILE_WIDTH } from './tiles.ts';
import BandWorker from './worker.ts?worker&inline';

const SHARPNESS = 0.13; // of a picture of full size; by 1/size more, which comes nearest to the fine picture
const [SHARPNESS_STEPS, MOST_SHARPNESS] = [64, 31]; // as the kernel takes them
const CLOTH_STEP = 8; // pixels

/** Draws with the processor alone: workers draw bands of each picture, this thread only shows them. */
class SoftPainter implements Painter {
  readonly path = 'soft';
  pixels: [number, number] = [0, 0];
  gaussians = 0;
  sortTook = 0; // into tiles, by the slowest worker
  drawTook: number | null = null;
  lastSortTime = 0;
  /** What the steps of the last picture took, ms: those of the slowest band, and showing it on this thread. */
  steps: Steps & { show: number } = { project: 0, spread: 0, bin: 0, blend: 0, show: 0 };
  readonly sorting = false;
  readonly presenting = false;
  readonly lost = false;
  readonly refines = true;
  private readonly context: CanvasRenderingContext2D;
  private readonly easel: Easel;
  private readonly workers: Worker[];
  private bands: Bands;
  private readonly known = new Map<SoftObject, { id: number; source: Source | null }>();
  private clothKey = '';
  private sharpness = 0; // 64ths
  private awaited = 0; // bands of the picture that is being drawn
  private drawn: Drawn[] = [];
  private frame: Omit<Frame, 'band'> | null = null;
  private waiting: (() => void)[] = []; // those who wait for the picture
  private readonly pulse = new Pulse(() => this.busy);

  constructor(easel: Easel) {
    this.context = easel.canvas.getContext('2d', { alpha: easel.transparent })!;
    this.easel = easel;
    // One core is left to this thread, to sound and to the conversation, which never wait for pictures.
    const count = Math.max(1, Math.min(workersFor(0), (navigator.hardwareConcurrency || 1) - 1));
    this.bands = new Bands(count);
    this.workers = Array.from({ length: count }, (_, i) => {
      const worker = new BandWorker();
      worker.onmessage = ({ data }: MessageEvent<Drawn>) => this.receive(i, data);
      return worker;
    });
  }

  get name(): string {
    return `the processor alone, ${this.workers.length} threads`;
  }

  get busy(): boolean {
    return this.awaited > 0;
  }

  loop(frame: ((now: number) => void) | null): void {
    this.pulse.run(frame);
  }

  fit(width: number, height: number, ratio: number, share: number): void {
    this.pixels = [Math.max(1, Math.floor(width * ratio * share)), Math.max(1, Math.floor(height * ratio * share))];
    // Sharpened edges would stand out against what is behind the page.
    this.sharpness = share < 1 && !this.easel.transparent ? Math.min(MOST_SHARPNESS, Math.round((SHARPNESS_STEPS * SHARPNESS) / share)) : 0;
  }

  paint(scene: Scene, camera: PerspectiveCamera): void {
    if (this.busy) return;
    scene.updateMatrixWorld();
    if (!camera.parent) camera.updateMatrixWorld();
    const [width, height] = this.pixels;
    const frame = { lens: lensOf(camera, width, height), width, height, placed: this.place(scene, camera) };
    const cloth = this.cloth(camera, width, height);
    this.frame = frame;
    this.awaited = this.workers.length;
    this.lastSortTime = performance.now();
    this.bands.of(Math.ceil(width / TILE_WIDTH)).forEach((band, i) => this.tell(i, { frame: { ...frame, band }, cloth, sharpness: this.sharpness }));
  }

  async settle(): Promise<void> {
    await this.shown();
  }

  async shown(): Promise<void> {
    if (this.busy) await new Promise<void>((resolve) => this.waiting.push(resolve));
  }

  dispose(): void {
    this.loop(null);
    for (const worker of this.workers) worker.terminate();
    for (const resolve of this.waiting.splice(0)) resolve();
  }

  private tell(worker: number, order: Order): void {
    this.workers[worker]!.postMessage(order);
  }

  /** What is seen of everybody; sources that are new are told to the workers. */
  private place(scene: Scene, camera: PerspectiveCamera): Placed[] {
    const placed: Placed[] = [];
    const fromCamera = new Matrix4().makeScale(1, -1, -1).multiply(camera.matrixWorldInverse);
    scene.traverseVisible((object: Object3D & { soft?: SoftObject }) => {
      const { soft } = object;
      if (!soft?.source || soft.drawn === 0) return;
      const m = new Matrix4().multiplyMatrices(fromCamera, object.matrixWorld).transpose();
      placed.push({ id: this.know(soft), view: Float32Array.from(m.elements.slice(0, 12)), drawn: soft.drawn, late: soft.late, values: soft.values });
    });
    return placed;
  }

  private know(soft: SoftObject): number {
    let known = this.known.get(soft);
    if (!known) this.known.set(soft, (known = { id: this.known.size, source: null }));
    if (known.source !== soft.source) {
      known.source = soft.source;
      this.spare();
      for (const i of this.workers.keys()) this.tell(i, { put: known.id, source: soft.source! });
    }
    return known.id;
  }

  /** Lets workers go that have no room for what is drawn: each keeps all of it. */
  private spare(): void {
    const bytes = [...this.known.values()].reduce((sum, { source }) => sum + (source?.rows.byteLength ?? 0), 0);
    const gone = this.workers.splice(workersFor(bytes));
    if (gone.length === 0) return;
    for (const worker of gone) worker.terminate();
    this.drawn = [];
    this.bands = new Bands(this.workers.length);
  }

  /** What is behind everybody as the camera sees it; null if it is as before. */
  private cloth(camera: PerspectiveCamera, width: number, height: number): Cloth | null {
    const { backcloth, background, transparent } = this.easel;
    const { shows } = backcloth;
    const view = shows ? [...camera.matrixWorld.elements, ...camera.projectionMatrix.elements, backcloth.version] : [];
    const key = [width, height, ...view].join();
    if (key === this.clothKey) return null;
    this.clothKey = key;
    const columns = Math.ceil((width + TILE_WIDTH) / CLOTH_STEP) + 2;
    const rows = Math.ceil(height / CLOTH_STEP) + 2;
    if (transparent) return { step: CLOTH_STEP, columns, colours: null };
    const colours = new Float32Array(3 * columns * rows);
    const [eye, way] = [new Vector3().setFromMatrixPosition(camera.matrixWorld), new Vector3()];
    for (let at = 0; at < colours.length; at += 3) {
      if (!shows) {
        colours.set(background, at);
        continue;
      }
      const [column, row] = [(at / 3) % columns, Math.floor(at / 3 / columns)];
      way.set((2 * (CLOTH_STEP * column + 0.5)) / width - 1, 1 - (2 * (CLOTH_STEP * row + 0.5)) / height, 0.5);
      backcloth.colour(eye, way.unproject(camera).sub(eye).normalize(), colours, at);
    }
    return { step: CLOTH_STEP, columns, colours };
  }

  private receive(worker: number, drawn: Drawn): void {
    this.drawn[worker] = drawn;
    if (--this.awaited > 0) return;
    const before = performance.now();
    const { width, height } = this.frame!;
    const { canvas } = this.context;
    if (canvas.width !== width) canvas.width = width;
    if (canvas.height !== height) canvas.height = height;
    for (const { part, pixels } of this.drawn) {
      if (!part) continue;
      const { columns: [left, right], rows: [top, bottom] } = part;
      this.context.putImageData(new ImageData(new Uint8ClampedArray(pixels), TILE_WIDTH * (right - left), bottom - top), TILE_WIDTH * left, top);
    }
    this.gaussians = Math.max(...this.drawn.map(({ gaussians }) => gaussians));
    const slowest = this.drawn.reduce((slow, one) => (one.took > slow.took ? one : slow));
    this.sortTook = slowest.steps.bin;
    const now = performance.now();
    this.drawTook = now - this.lastSortTime;
    this.steps = { ...slowest.steps, show: now - before };
    this.bands.took(this.drawn.map(({ took }) => took));
    for (const resolve of this.waiting.splice(0)) resolve();
    this.pulse.done();
  }
}

/** Focal lengths and the principal point, pixels. */
function lensOf({ projectionMatrix: { elements: e } }: PerspectiveCamera, width: number, height: number): Frame['lens'] {
  return [(e[0]! * width) / 2, (e[5]! * height) / 2, ((1 - e[8]!) * width) / 2, ((1 + e[9]!) * height) / 2];
}

export const makeSoftPainter: MakePainter = (easel) => new SoftPainter(easel);
