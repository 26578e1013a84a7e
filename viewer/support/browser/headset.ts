import { join } from 'node:path';
import type { Page } from 'playwright-core';
import type { XRDevice } from 'iwer';
import type { Immersion } from '../../src/xr/immersion.ts';

declare global {
  interface Window {
    IWER: typeof import('iwer');
    headset: XRDevice;
    /** The visit by headset that goes on now. */
    immersion: () => Immersion;
  }
}

const EMULATOR = join(import.meta.dirname, '../../node_modules/iwer/build/iwer.min.js');

/**
 * Gives a page an emulated headset, before it is opened. The emulator draws both eyes into the page's
 * own canvas, which gets what the layers of a session have: an alpha, and pixels that may be read.
 */
export async function plugIn(page: Page): Promise<void> {
  await page.addInitScript({ path: EMULATOR });
  await page.addInitScript(() => {
    const { getContext } = HTMLCanvasElement.prototype;
    HTMLCanvasElement.prototype.getContext = function (this: HTMLCanvasElement, kind: string, options?: object) {
      return (getContext as (...given: unknown[]) => RenderingContext).call(this, kind, { ...options, alpha: true, preserveDrawingBuffer: true });
    } as typeof getContext;
    const { XRDevice, metaQuest3 } = window.IWER;
    window.headset = new XRDevice(metaQuest3, { stereoEnabled: true });
    window.headset.installRuntime({ forceInstall: true }); // Chromium has a runtime of its own
    window.headset.position.set(0.3, 1.5, 0.2);
    window.immersion = () => (window.ico3d!.stage as unknown as { presentation: Immersion }).presentation;
  });
}

/** Clicks a button that enters VR or AR, and waits until the visitor is there. */
export async function enter(page: Page, button: string): Promise<void> {
  await page.getByRole('button', { name: button }).click(); // in small windows it shows an icon alone
  await page.waitForFunction(() => window.ico3d!.stage.renderer.xr.isPresenting);
  await drawn(page, 2);
}

/** Waits for further pictures. */
export async function drawn(page: Page, count: number): Promise<void> {
  const before = await page.evaluate(() => window.ico3d!.stage.frames);
  await page.waitForFunction((frames) => window.ico3d!.stage.frames >= frames, before + count);
}

/** What both eyes see together: (H, W, 4) with the left one's half at the left, last row first. */
export async function seen(page: Page): Promise<{ width: number; height: number; pixels: Buffer }> {
  const { width, height, encoded } = await page.evaluate(() => {
    const gl = window.ico3d!.stage.renderer.getContext();
    const { drawingBufferWidth: width, drawingBufferHeight: height } = gl;
    const rgba = new Uint8Array(4 * width * height);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, rgba);
    window.ico3d!.stage.renderer.resetState();
    return { width, height, encoded: btoa(rgba.reduce((text, value) => text + String.fromCharCode(value), '')) };
  });
  return { width, height, pixels: Buffer.from(encoded, 'base64') };
}
