import { SparkRenderer } from '@sparkjsdev/spark';
import type { WebGLRenderer } from 'three';
import { keepUnchanged } from './reuse.ts';

const LEAST_ALPHA = 1 / 255; // a splat ends where its alpha falls under this

/** Spark, set to the filter that bundles are trained with (`docs/bundle.md`, rendering). */
export class Sorter extends SparkRenderer {
  sortTook = 0; // ms, of the last sort with what it reads from the GPU
  private timed = 0; // when that sort began, ms of the performance clock

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
