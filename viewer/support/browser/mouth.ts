import type { Page } from 'playwright-core';
import type { Manifest } from '../../src/bundle/manifest.ts';
import { drawSeldom, hideBody } from './drawing.ts';

/** The speech in the face's expression at one moment. */
export interface Sight {
  at: number; // ms, the page's performance clock
  speech: number; // distance of the speech features from those at rest
}

/** What a drawn picture shows of the mouth. */
export interface Picture {
  at: number;
  change: number; // levels of 255 from the first picture, mean of the 1 % of the lower half that differs most
}

const PICTURE_EVERY = 400; // ms: software rendering takes its share of the processor from recogniser and voice

declare global {
  interface Window {
    mouth?: { sights: Sight[]; pictures: Picture[] };
  }
}

/**
 * Watches the mouth of a face that is at rest now: its expression at each tick, and a picture of the
 * head alone now and then; no others are drawn.
 *
 * @param every ms from one picture to the next
 */
export async function watchMouth(page: Page, every = PICTURE_EVERY): Promise<void> {
  await drawSeldom(page);
  await hideBody(page);
  await page.evaluate(async (every) => {
    const FEATURES = 32; // of speech; those of the eyes follow
    const SETTLED = 3; // pictures in a row that do not differ
    const { stage, head } = window.ico3d!;
    const { camera: start } = (await (await fetch('bundle/manifest.json')).json()) as Manifest;
    stage.orbit.look(start); // from there on nothing moves the camera
    window.draw!(); // the camera's matrices are those of the last picture
    const record: NonNullable<Window['mouth']> = { sights: [], pictures: [] };
    window.mouth = record;
    const gl = stage.renderer.getContext();
    if (window.ico3d!.body ?? window.ico3d!.skinned) {
      // Of a whole person the face is but a few pixels: look closer, through the same lens.
      const { camera } = stage.orbit;
      const reach = 0.14; // m about the head's middle
      const middle = head!.generator.getWorldPosition(camera.position.clone());
      const depth = camera.position.distanceTo(middle);
      const { x, y } = middle.project(camera);
      const side = reach / (depth * Math.tan((camera.fov * Math.PI) / 360)); // of half the picture's height
      const [width, height] = [camera.aspect, 1];
      camera.setViewOffset(
        width,
        height,
        ((x + 1) * width - side * width) / 2,
        ((1 - y) * height - side * height) / 2,
        side * width,
        side * height,
      );
    }
    const { generator, expression } = head!;
    const rest = expression.slice();
    const shown = expression.slice();
    const lowerHalf = () => {
      // Only the mouth may differ: lids reach into the lower half, and move lips after a short training.
      shown.set(expression.subarray(0, FEATURES));
      generator.express(shown);
      window.draw!();
      generator.express(expression);
      const [width, height] = [gl.drawingBufferWidth, gl.drawingBufferHeight >> 1];
      const rgba = new Uint8Array(4 * width * height);
      gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, rgba); // WebGL counts rows from below
      return rgba;
    };
    let restPicture = lowerHalf();
    for (let alike = 0; alike < SETTLED; ) {
      // Splats are sorted aside: only then is this what is seen from there.
      await new Promise((resolve) => setTimeout(resolve, 100));
      const next = lowerHalf();
      alike = next.every((level, i) => level === restPicture[i]) ? alike + 1 : 0;
      restPicture = next;
    }
    const change = () => {
      const differences = lowerHalf().map((level, i) => Math.abs(level - restPicture[i]!)).sort();
      const most = differences.subarray(-Math.ceil(differences.length / 100));
      return most.reduce((sum, level) => sum + level, 0) / most.length;
    };
    setInterval(() => {
      const at = performance.now();
      record.sights.push({ at, speech: Math.hypot(...rest.subarray(0, FEATURES).map((value, i) => value - expression[i]!)) });
      if (at - (record.pictures.at(-1)?.at ?? 0) > every) record.pictures.push({ at, change: change() });
    }, 33);
  }, every);
}

/** Everything watched so far. */
export function readMouth(page: Page): Promise<NonNullable<Window['mouth']>> {
  return page.evaluate(() => window.mouth!);
}
