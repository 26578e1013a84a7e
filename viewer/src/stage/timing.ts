import type { Object3D } from 'three';
import type { Stage } from './stage.ts';

/** What pictures of some objects take. */
export interface Timing {
  gaussians: number; // drawn
  evaluation: number; // ms, median
  picture: number; // ms until it is drawn, evaluation included, median
  sort: number; // ms of the last sort, beside the pictures
}

const STEP = 1 / 30; // s of what happens between two pictures
const PICTURES = 120; // at most
const LEAST = 5; // pictures
const FIRST = 2; // pictures that do not count: programs are compiled

/**
 * Draws pictures of some objects one after another, as fast as can be, while everybody moves on; then
 * everything is seen again. The stage stands still afterwards.
 *
 * @param all objects on stage
 * @param seen those of which pictures are drawn
 * @param seconds after which it is enough
 */
export async function timePictures(stage: Stage, all: readonly Object3D[], seen: readonly Object3D[], seconds: number): Promise<Timing> {
  for (const object of all) object.visible = seen.includes(object);
  await stage.still();
  const [evaluations, pictures]: [number[], number[]] = [[], []];
  const end = performance.now() + 1000 * seconds;
  for (let i = -FIRST; i < LEAST || (i < PICTURES && performance.now() < end); i++) {
    await new Promise((resolve) => setTimeout(resolve)); // lets sorts and windows arrive
    const before = performance.now();
    stage.advance(STEP);
    const evaluated = performance.now();
    stage.draw();
    await stage.painter.shown();
    if (i < 0) continue;
    evaluations.push(evaluated - before);
    pictures.push(performance.now() - before);
  }
  const { gaussians, sort } = stage.figures;
  for (const object of all) object.visible = true;
  return { gaussians, evaluation: median(evaluations), picture: median(pictures), sort };
}

function median(values: number[]): number {
  return values.toSorted((a, b) => a - b)[values.length >> 1]!;
}
