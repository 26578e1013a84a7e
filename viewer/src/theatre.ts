/** What brings somebody on stage: a page that loads this by itself can be used before. What draws is in `painters/`. */
export { makeCast, refine } from './cast.ts';
export { Stage } from './stage/stage.ts';
export { makeViewBar } from './ui/views.ts';
