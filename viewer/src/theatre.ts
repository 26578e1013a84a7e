/** What draws somebody, with three and Spark: a page that loads this by itself can be used before. */
export { makeCast, refine } from './cast.ts';
export { Stage } from './stage/stage.ts';
export { makeViewBar } from './ui/views.ts';
