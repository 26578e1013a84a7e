import type { Page } from 'playwright-core';

/** What the page drew of one expression. */
export interface Still {
  pixels: Uint8Array; // (H, W, 3), top row first
  attributes: Float32Array; // (N, 4)
  coefficients: number[];
}

/** Shows one expression with the head in its first pose and reads everything back. */
export async function takeStill(page: Page, expression: number[]): Promise<Still> {
  const still = await page.evaluate(async (row) => {
    const { stage, attributes } = window.ico3d!;
    await stage.still(row);
    const { width, height } = stage.renderer.domElement;
    const rgba = new Uint8Array(4 * width * height);
    const gl = stage.renderer.getContext();
    stage.draw();
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, rgba);
    return { width, height, rgba: [...rgba], attributes: [...attributes()], coefficients: [...stage.head.shown] };
  }, expression);
  const { width, height, rgba, attributes, coefficients } = still;
  const pixels = new Uint8Array(3 * width * height);
  for (let i = 0; i < width * height; i++) {
    const source = (height - 1 - Math.floor(i / width)) * width + (i % width); // WebGL counts rows from below
    pixels.set(rgba.slice(4 * source, 4 * source + 3), 3 * i);
  }
  return { pixels, attributes: Float32Array.from(attributes), coefficients };
}

/** Peak signal-to-noise ratio of two 8-bit pictures, dB. */
export function psnr(a: Uint8Array, b: Uint8Array): number {
  if (a.length !== b.length) throw new Error(`pictures of ${a.length} and ${b.length} bytes`);
  const squares = a.reduce((sum, value, i) => sum + (value - b[i]!) ** 2, 0);
  return 10 * Math.log10((255 * 255 * a.length) / squares);
}

/** The largest difference between two arrays. */
export function worst(a: ArrayLike<number>, b: ArrayLike<number>): number {
  return Array.from(a).reduce((most, value, i) => Math.max(most, Math.abs(value - b[i]!)), 0);
}
