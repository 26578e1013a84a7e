import type { Page } from 'playwright-core';

declare global {
  interface Window {
    /** Draws what is on stage now; what the canvas holds may be read until the current task ends. */
    draw?: () => void;
  }
}

/**
 * From now on the page draws each `every`-th picture only, by default none, unless `window.draw` is
 * called: all but the picture goes on as before, and software rendering does not take the processor
 * from what is tested.
 *
 * @param every pictures due for one that is drawn
 */
export function drawSeldom(page: Page, every = Infinity): Promise<void> {
  return page.evaluate((every) => {
    const { stage } = window.ico3d!;
    const draw = () => Object.getPrototypeOf(stage).draw.call(stage) as void;
    let due = 0;
    window.draw = draw;
    stage.draw = () => {
      if (++due % every === 0) draw();
    };
  }, every);
}

/**
 * Leaves the head alone on stage. A software GPU takes 20 µs for each Gaussian, however few pixels
 * there are, and nine in ten are those of a body's windows.
 */
export function hideBody(page: Page): Promise<void> {
  return page.evaluate(() => {
    const { body, skinned } = window.ico3d!;
    for (const object of (body ?? skinned)?.objects ?? []) object.visible = false;
  });
}

/** Stops time on stage, too: faces stand still and nothing is drawn. */
export function pauseDrawing(page: Page): Promise<void> {
  return page.evaluate(() => void window.ico3d!.stage.painter.loop(null));
}

/** When the page is loaded next, time on it passes by the pictures that are drawn: a busy machine plays slowly instead of stalling. */
export async function playByPictures(page: Page): Promise<void> {
  await page.addInitScript(() => {
    const LONGEST = 1000 / 30; // ms from one picture to the next
    let [time, last] = [0, 0];
    const request = window.requestAnimationFrame.bind(window);
    window.requestAnimationFrame = (draw) =>
      request((now) => {
        time += Math.min(now - last, LONGEST);
        last = now;
        draw(time);
      });
  });
}

/** Waits for two refreshes of the screen: until input and the page's observers of itself have had their effect. */
export function refreshed(page: Page): Promise<unknown> {
  return page.evaluate(() => new Promise((resolve) => requestAnimationFrame(() => requestAnimationFrame(resolve))));
}

/** Draws a person whose face is at rest at a time of the recording, well sorted. */
export async function stillPerson(page: Page, time: number): Promise<void> {
  await page.evaluate(async (seconds) => {
    const { stage, body, skinned, head } = window.ico3d!;
    head!.director = null;
    stage.start();
    await (body ?? skinned)!.show(seconds);
    head!.express(new Float32Array(head!.expression.length));
    await stage.still();
  }, time);
}
