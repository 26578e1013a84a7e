import type { Page } from 'playwright-core';

const LEAST = 24; // levels of 255, of three colours together, by which a pixel shows the head

/**
 * Which elements lie over the head, hair and all, with the number of its pixels that each of them is over.
 * The head is found on the picture itself, which the processor draws: it is what changes without it.
 *
 * @param selector of the elements; those that are not seen do not count
 */
export function overHead(page: Page, selector: string): Promise<{ head: number; over: string[] }> {
  return page.evaluate(async ([selector, least]) => {
    const { stage, head } = window.ico3d!;
    const canvas = document.querySelector<HTMLCanvasElement>('#stage')!;
    const shown = async (visible: boolean) => {
      head!.generator.visible = visible;
      await stage.still();
      return canvas.getContext('2d')!.getImageData(0, 0, canvas.width, canvas.height).data;
    };
    const [without, whole] = [await shown(false), await shown(true)];
    stage.start();
    const isHead = (pixel: number) => [0, 1, 2].reduce((sum, c) => sum + Math.abs(whole[4 * pixel + c]! - without[4 * pixel + c]!), 0) > least;
    const pixels = Array.from({ length: canvas.width * canvas.height }, (_, pixel) => pixel).filter(isHead);
    const scale = canvas.width / canvas.clientWidth;
    const place = canvas.getBoundingClientRect();
    const over = [...document.querySelectorAll<HTMLElement>(selector)].flatMap((element) => {
      const { left, right, top, bottom, width, height } = element.getBoundingClientRect();
      if (!width || !height || element.matches('.gone')) return [];
      const covered = pixels.filter((pixel) => {
        const [x, y] = [(pixel % canvas.width) / scale + place.left, Math.floor(pixel / canvas.width) / scale + place.top];
        return x >= left && x < right && y >= top && y < bottom;
      });
      return covered.length > 0 ? [`${element.id || element.title || element.textContent}: ${covered.length}`] : [];
    });
    return { head: pixels.length, over };
  }, [selector, LEAST] as const);
}
