/** In the page: frames drawn as fast as can be. */
import type { Stage } from '../../src/stage/stage.ts';

/** A frame that was drawn. */
export interface Frame {
  ms: number; // since the one before
  window: number; // of a body of windows, else -1
  uploaded: boolean; // a window into the idle slot
}

declare global {
  interface Window {
    scenes?: { animated(frames: number): Promise<Frame[]>; still(frames: number): Promise<Frame[]> };
  }
}

/**
 * Draws frames; one ends when the GPU has done all of it.
 *
 * @param change makes the next frame another one than the last
 * @param seen what a frame showed, as soon as it is drawn
 */
export async function drawFrames(stage: Stage, count: number, change: () => void, seen: () => Omit<Frame, 'ms'>): Promise<Frame[]> {
  const gl = stage.renderer.getContext();
  await stage.still();
  const log: Frame[] = [];
  for (let last = NaN; log.length < count; ) {
    await new Promise((resolve) => setTimeout(resolve)); // lets sorts and windows arrive
    change();
    stage.draw();
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
    const now = performance.now();
    if (!Number.isNaN(last)) log.push({ ms: now - last, ...seen() });
    last = now;
  }
  return log;
}
