import type { Page } from 'playwright-core';

/** Where the eyes are on the picture, in shares of its height, from the left and from above. */
export interface Eyes {
  x: number;
  y: number;
  apart: number; // from the outer end of one to that of the other
}

/**
 * Finds the eyes on the picture itself: they are what changes when the lids of a still person close.
 * The page draws seldom (`drawing.ts`).
 */
export function seeEyes(page: Page): Promise<Eyes> {
  return page.evaluate(async () => {
    const LIDS = [37, 38];
    const LEAST = 90; // levels of 255, of three colours together: skin about the lids moves with them, too
    const { stage, head } = window.ico3d!;
    const gl = stage.renderer.getContext();
    const director = head!.director;
    head!.director = null;
    const open = head!.expression.slice();
    for (const lid of LIDS) open[lid] = 0;
    const closed = open.map((value, i) => (LIDS.includes(i) ? 1 : value));
    const [width, height] = [gl.drawingBufferWidth, gl.drawingBufferHeight];
    const pictures: Uint8Array[] = [];
    for (const expression of [open, closed]) {
      head!.express(expression);
      await stage.still();
      const rgba = new Uint8Array(4 * width * height);
      window.draw!();
      gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, rgba);
      pictures.push(rgba);
    }
    head!.director = director;
    stage.start();
    const [columns, rows]: [number[], number[]] = [[], []];
    for (let i = 0; i < width * height; i++) {
      const change = [0, 1, 2].reduce((sum, c) => sum + Math.abs(pictures[0]![4 * i + c]! - pictures[1]![4 * i + c]!), 0);
      if (change < LEAST) continue;
      columns.push((i % width) / height);
      rows.push(1 - Math.floor(i / width) / height); // WebGL counts rows from below
    }
    const share = (values: number[], part: number) => values.sort((a, b) => a - b)[Math.floor(part * (values.length - 1))]!;
    const [left, right] = [share(columns, 0.03), share(columns, 0.97)];
    return { x: (left + right) / 2, y: share(rows, 0.5), apart: right - left };
  });
}

/** How far down the chin of the packaged avatar is, as a share of the picture's height. */
export function seeChin(page: Page): Promise<number> {
  return page.evaluate(() => {
    const { stage, head } = window.ico3d!;
    const { generator } = head!;
    const chin = generator.position.clone().set(0, -0.105, 0.08); // the lowest of its head's Gaussians
    return (1 - chin.applyMatrix4(generator.matrixWorld).project(stage.orbit.camera).y) / 2;
  });
}
