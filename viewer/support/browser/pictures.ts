import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import type { Page } from 'playwright-core';
import type { Manifest } from '../../src/bundle/manifest.ts';

/** What the page drew of one expression. */
export interface Still {
  pixels: Uint8Array; // (H, W, 3), top row first
  attributes: Float32Array; // (N, 4)
  coefficients: number[];
}

/** Shows one expression with the head in its first pose and reads everything back. */
export async function takeStill(page: Page, expression: number[]): Promise<Still> {
  const { attributes, coefficients } = await page.evaluate(async (row) => {
    const { stage, head, splats } = window.ico3d!;
    head!.express(row);
    head!.place(0);
    await stage.still();
    const { rgba } = splats(head!.generator);
    return { attributes: [...rgba].join(), coefficients: [...head!.generator.shown] };
  }, expression);
  return { pixels: await takePixels(page), attributes: Float32Array.from(attributes.split(','), Number), coefficients };
}

/** Looks from where the bundle in a folder says, as Python's references do. */
export async function lookAsBundled(page: Page, folder: string): Promise<void> {
  const { camera } = JSON.parse(readFileSync(join(folder, 'manifest.json'), 'utf8')) as Manifest;
  await page.evaluate((view) => window.ico3d!.stage.orbit.look(view), camera);
}

/** Draws what is on stage, before a plain colour as in Python, and reads it back: (H, W, 3), top row first. */
export async function takePixels(page: Page): Promise<Uint8Array> {
  const { width, height, encoded } = await page.evaluate(() => {
    const { stage } = window.ico3d!;
    const { width, height } = stage.renderer.domElement;
    const rgba = new Uint8Array(4 * width * height);
    const gl = stage.renderer.getContext();
    stage.scenery.visible = false;
    stage.draw();
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, rgba);
    return { width, height, encoded: btoa(rgba.reduce((text, value) => text + String.fromCharCode(value), '')) };
  });
  const rgba = Buffer.from(encoded, 'base64'); // many times faster than an array of numbers
  const pixels = new Uint8Array(3 * width * height);
  for (let i = 0; i < width * height; i++) {
    const source = (height - 1 - Math.floor(i / width)) * width + (i % width); // WebGL counts rows from below
    pixels.set(rgba.subarray(4 * source, 4 * source + 3), 3 * i);
  }
  return pixels;
}

/** What the canvas shows of a page that draws without WebGL: (H, W, 3). */
export async function shownPixels(page: Page): Promise<Uint8Array> {
  const encoded = await page.evaluate(() => {
    const canvas = document.querySelector<HTMLCanvasElement>('#stage')!;
    const { data } = canvas.getContext('2d')!.getImageData(0, 0, canvas.width, canvas.height);
    return btoa(data.reduce((text, value) => text + String.fromCharCode(value), ''));
  });
  return new Uint8Array(Buffer.from(encoded, 'base64')).filter((_, at) => at % 4 < 3);
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

/** A part of a picture (H, W, 3). */
export function crop(
  picture: Uint8Array,
  width: number,
  part: { left: number; top: number; width: number; height: number },
): Uint8Array {
  const rows = Array.from({ length: part.height }, (_, y) => {
    const begin = 3 * ((part.top + y) * width + part.left);
    return [...picture.subarray(begin, begin + 3 * part.width)];
  });
  return Uint8Array.from(rows.flat());
}
