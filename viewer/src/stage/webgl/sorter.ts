import { SparkRenderer } from '@sparkjsdev/spark';
import type { DataTexture, WebGLRenderer } from 'three';
import { without, type Ordering, type Span } from './ordering.ts';
import { keepUnchanged } from './reuse.ts';

const LEAST_ALPHA = 1 / 255; // a splat ends where its alpha falls under this

/** An object that takes part in sorting though nobody sees it yet. */
export interface Waiting {
  unseen: boolean;
}

type Worker = NonNullable<SparkRenderer['sortWorker']>;

/** What is asked of a worker when Gaussians are to be sorted. */
interface SortPort {
  call(name: string, args: unknown): Promise<{ ordering: Uint32Array; activeSplats: number }>;
}

/** Spark, set to the filter that bundles are trained with (`docs/bundle.md`, rendering). */
export class Sorter extends SparkRenderer {
  sortTook = 0; // ms, of the last sort with what it reads from the GPU
  private timed = 0; // when that sort began, ms of the performance clock
  private whole: Ordering | null = null; // of the last sort, with what nobody sees yet
  private left: readonly Span[] = []; // what of it pictures leave out now

  constructor(renderer: WebGLRenderer, onDirty: () => void) {
    super({
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
    keepUnchanged(this);
    let worker = this.sortWorker;
    Object.defineProperty(this, 'sortWorker', { get: () => worker, set: (given: typeof worker) => (worker = given && this.watch(given)) });
  }

  /**
   * Leaves those out of the next picture that take part in sorting so that they can appear at once,
   * but are not seen yet: the GPU would take time for each of them.
   */
  sift(): void {
    const unseen = this.unseen();
    const same = unseen.length === this.left.length && unseen.every(({ base }, i) => base === this.left[i]!.base);
    if (same || !this.whole || !this.orderingTexture) return;
    const { order, count } = this.leave(this.whole, unseen);
    const texture = this.orderingTexture as DataTexture;
    texture.image.data = order;
    texture.needsUpdate = true;
    this.activeSplats = count;
  }

  /** Reads along what the worker has sorted. */
  private watch(worker: Worker): Worker {
    const port = worker as unknown as SortPort;
    const call = port.call.bind(worker);
    port.call = async (name, args) => {
      const { mappingVersion } = this.current;
      const result = await call(name, args);
      if (name !== 'sortSplats32') return result;
      this.whole = { order: result.ordering, count: result.activeSplats };
      const { order, count } = this.leave(this.whole, this.current.mappingVersion === mappingVersion ? this.unseen() : []);
      return { ...result, ordering: order, activeSplats: count };
    };
    return worker;
  }

  private leave(whole: Ordering, spans: readonly Span[]): Ordering {
    this.left = spans;
    return spans.length > 0 ? without(whole, spans) : whole;
  }

  private unseen(): Span[] {
    return this.current.mapping.filter(({ node }) => (node as Partial<Waiting>).unseen);
  }

  /** Spark calls this when a sort has ended, among others. */
  override setDirty(): void {
    if (!this.sorting && this.lastSortTime > this.timed) {
      this.sortTook = performance.now() - this.lastSortTime;
      this.timed = this.lastSortTime;
    }
    super.setDirty();
  }
}
