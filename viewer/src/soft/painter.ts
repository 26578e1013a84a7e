import { Matrix4, Vector3, type Object3D, type PerspectiveCamera, type Scene } from 'three';
import type { Backcloth, MakePainter, Painter } from './contract.ts';
import type { Cloth, Drawn, Order } from './band.ts';
import { Bands } from './bands.ts';
import type { Frame, Placed } from './rasteriser.ts';
import type { SoftObject, Source } from './source.ts';
import { TILE_WIDTH } from './tiles.ts';
import BandWorker from './worker.ts?worker&inline';

const MOST_WORKERS = 4;
const CLOTH_STEP = 8; // pixels

/** Draws with the processor alone: workers draw bands of each picture, this thread only shows them. */
class SoftPainter implements Painter {
  pixels: [number, number] = [0, 0];
  gaussians = 0;
  sortTook = 0;
  lastSortTime = 0;
  readonly sorting = false;
  readonly presenting = false;
  readonly lost = false;
  private readonly context: CanvasRenderingContext2D;
  private readonly background: readonly [number, number, number];
  private readonly backcloth: Backcloth | null;
  private readonly workers: Worker[];
  private readonly bands: Bands;
  private readonly known = new Map<SoftObject, { id: number; source: Source | null }>();
  private clothKey = '';
  private awaited = 0; // bands of the picture that is being drawn
  private drawn: Drawn[] = [];
  private frame: Omit<Frame, 'band'> | null = null;
  private places: [first: number, end: number][] = [];
  private waiting: (() => void)[] = []; // those who wait for the picture
  private request = 0; // of an animation frame

  constructor(...[canvas, background, backcloth]: Parameters<MakePainter>) {
    this.context = canvas.getContext('2d', { alpha: false })!;
    this.background = background;
    this.backcloth = backcloth;
    const count = Math.max(1, Math.min(MOST_WORKERS, navigator.hardwareConcurrency || 1));
    this.bands = new Bands(count);
    this.workers = Array.from({ length: count }, (_, i) => {
      const worker = new BandWorker();
      worker.onmessage = ({ data }: MessageEvent<Drawn>) => this.receive(i, data);
      return worker;
    });
  }

  get busy(): boolean {
    return this.awaited > 0;
  }

  loop(frame: ((now: number) => void) | null): void {
    cancelAnimationFrame(this.request);
    if (!frame) return;
    const next = (now: number) => {
      this.request = requestAnimationFrame(next);
      frame(now);
    };
    this.request = requestAnimationFrame(next);
  }

  fit(width: number, height: number, ratio: number): void {
    this.pixels = [Math.max(1, Math.floor(width * ratio)), Math.max(1, Math.floor(height * ratio))];
  }

  paint(scene: Scene, camera: PerspectiveCamera): void {
    if (this.busy) return;
    scene.updateMatrixWorld();
    if (!camera.parent) camera.updateMatrixWorld();
    const [width, height] = this.pixels;
    const frame = { lens: lensOf(camera, width, height), width, height, placed: this.place(scene, camera) };
    const cloth = this.cloth(camera, width, height);
    this.frame = frame;
    this.places = this.bands.of(Math.ceil(width / TILE_WIDTH));
    this.awaited = this.workers.length;
    this.lastSortTime = performance.now();
    this.places.forEach((band, i) => this.tell(i, { frame: { ...frame, band }, cloth }));
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
      placed.push({ id: this.know(soft), view: Float32Array.from(m.elements.slice(0, 12)), drawn: soft.drawn, values: soft.values });
    });
    return placed;
  }

  private know(soft: SoftObject): number {
    let known = this.known.get(soft);
    if (!known) this.known.set(soft, (known = { id: this.known.size, source: null }));
    if (known.source !== soft.source) {
      known.source = soft.source;
      for (const i of this.workers.keys()) this.tell(i, { put: known.id, source: soft.source! });
    }
    return known.id;
  }

  /** What is behind everybody as the camera sees it; null if it is as before. */
  private cloth(camera: PerspectiveCamera, width: number, height: number): Cloth | null {
    const { backcloth } = this;
    const shows = backcloth?.shows;
    const view = shows ? [...camera.matrixWorld.elements, ...camera.projectionMatrix.elements, backcloth.version] : [];
    const key = [width, height, ...view].join();
    if (key === this.clothKey) return null;
    this.clothKey = key;
    const columns = Math.ceil((width + TILE_WIDTH) / CLOTH_STEP) + 2;
    const rows = Math.ceil(height / CLOTH_STEP) + 2;
    const colours = new Float32Array(3 * columns * rows);
    const [eye, way] = [new Vector3().setFromMatrixPosition(camera.matrixWorld), new Vector3()];
    for (let at = 0; at < colours.length; at += 3) {
      if (!shows) {
        colours.set(this.background, at);
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
    const { width, height } = this.frame!;
    const { canvas } = this.context;
    if (canvas.width !== width) canvas.width = width;
    if (canvas.height !== height) canvas.height = height;
    this.places.forEach(([first, end], i) => {
      if (end === first) return;
      const pixels = new Uint8ClampedArray(this.drawn[i]!.pixels);
      this.context.putImageData(new ImageData(pixels, TILE_WIDTH * (end - first), height), TILE_WIDTH * first, 0);
    });
    this.gaussians = Math.max(...this.drawn.map(({ gaussians }) => gaussians));
    this.sortTook = Math.max(...this.drawn.map(({ took }) => took));
    this.bands.took(this.drawn.map(({ took }) => took));
    for (const resolve of this.waiting.splice(0)) resolve();
  }
}

/** Focal lengths and the principal point, pixels. */
function lensOf({ projectionMatrix: { elements: e } }: PerspectiveCamera, width: number, height: number): Frame['lens'] {
  return [(e[0]! * width) / 2, (e[5]! * height) / 2, ((1 - e[8]!) * width) / 2, ((1 + e[9]!) * height) / 2];
}

export const makeSoftPainter: MakePainter = (...given) => new SoftPainter(...given);
