import type { BrowserContext } from 'playwright-core';

/** What may draw: Spark by WebGL, or the processor alone. */
export type Path = 'webgl' | 'soft';

/**
 * A page's address with which one path draws. Without it the page chooses by itself: the browser of the
 * tests draws WebGL in software, so the processor alone.
 */
export function drawnBy(path: Path, url: string): string {
  const address = new URL(url);
  address.searchParams.set('draw', path);
  return address.href;
}

/** From now on pages of a context are in a browser that has no WebGL. */
export function withoutWebGL(context: BrowserContext): Promise<unknown> {
  return context.addInitScript(() => {
    const { getContext } = HTMLCanvasElement.prototype;
    HTMLCanvasElement.prototype.getContext = function (this: HTMLCanvasElement, kind: string, ...rest: unknown[]) {
      return kind.startsWith('webgl') ? null : (getContext as (...given: unknown[]) => unknown).call(this, kind, ...rest);
    } as typeof getContext;
  });
}

/** The graphics card that `pretendCard` tells of. */
export const CARD = 'ANGLE (NVIDIA, NVIDIA GeForce RTX 3060)';

/** From now on the browser of a context says that a graphics card draws. */
export function pretendCard(context: BrowserContext): Promise<unknown> {
  return context.addInitScript((name) => {
    const { getContext } = HTMLCanvasElement.prototype;
    HTMLCanvasElement.prototype.getContext = function (this: HTMLCanvasElement, kind: string, settings?: WebGLContextAttributes) {
      return (getContext as (...given: unknown[]) => unknown).call(this, kind, { ...settings, failIfMajorPerformanceCaveat: false });
    } as typeof getContext;
    const { getParameter } = WebGL2RenderingContext.prototype;
    WebGL2RenderingContext.prototype.getParameter = function (what) {
      return what === 0x9246 ? name : getParameter.call(this, what); // UNMASKED_RENDERER_WEBGL
    };
  }, CARD);
}
