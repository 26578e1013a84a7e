import type { Page } from 'playwright-core';

const LEAST = 24; // levels of 255, of three colours together, by which a pixel shows the head

declare global {
  interface Window {
    /** Where the head is on pictures that were looked at: numbers of pixels, by the camera and the size of the picture. */
    heads?: Map<string, number[]>;
  }
}

/**
 * Which elements lie over the head, hair and all, with the number of its pixels that each of them is over.
 * The head is found on the picture itself, which the processor draws: it is what changes without it. A
 * visitor wants little motion, so where the camera was before, the head is where it was; nothing is drawn
 * by itself any more.
 *
 * @param selector of the elements; those that are not seen do not count
 */
export function overHead(page: Page, selector: string): Promise<{ head: number; over: string[] }> {
  return page.evaluate(async ([selector, least]) => {
    const { stage, head } = window.ico3d!;
    const canvas = document.querySelector<HTMLCanvasElement>('#stage')!;
    const [width, height] = stage.painter.pixels; // the canvas has them once it is drawn on
    const shown = async (visible: boolean) => {
      head!.generator.visible = visible;
      await stage.still();
      return canvas.getContext('2d')!.getImageData(0, 0, width, height).data;
    };
    const find = async () => {
      const [without, whole] = [await shown(false), await shown(true)];
      const found: number[] = [];
      for (let at = 0; at < whole.length; at += 4) {
        let change = 0;
        for (let c = at; c < at + 3; c++) change += Math.abs(whole[c]! - without[c]!);
        if (change > least) found.push(at / 4);
      }
      return found;
    };
    stage.orbit.update();
    const { position, quaternion, projectionMatrix } = stage.orbit.camera;
    const view = [width, height, ...position, ...quaternion, ...projectionMatrix.elements].join();
    const heads = (window.heads ??= new Map<string, number[]>());
    if (!heads.has(view)) heads.set(view, await find());
    const pixels = heads.get(view)!;
    const scale = width / canvas.clientWidth;
    const place = canvas.getBoundingClientRect();
    const over = [...document.querySelectorAll<HTMLElement>(selector)].flatMap((element) => {
      const box = element.getBoundingClientRect();
      if (!box.width || !box.height || element.matches('.gone')) return [];
      let covered = 0;
      for (const pixel of pixels) {
        const x = (pixel % width) / scale + place.left;
        const y = Math.floor(pixel / width) / scale + place.top;
        if (x >= box.left && x < box.right && y >= box.top && y < box.bottom) covered++;
      }
      return covered > 0 ? [`${element.id || element.title || element.textContent}: ${covered}`] : [];
    });
    return { head: pixels.length, over };
  }, [selector, LEAST] as const);
}
