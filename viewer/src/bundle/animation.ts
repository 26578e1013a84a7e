import { PageError } from '../errors.ts';
import type { AnyBody } from './manifest.ts';

/** What the page reads of `animation.json`; `docs/bundle.md` describes it whole. */
export interface AnimationInfo {
  fps: number; // of the body
  num_frames: number;
  rest: { start: number; end: number }; // frames: the loop of a person who is silent
  min_speed: number; // captured seconds per second
  max_speed: number;
}

const VERSION = 1;

/**
 * Checks a parsed `animation.json` as far as the page relies on it.
 *
 * @throws PageError naming the first thing that is wrong
 */
export function checkAnimation(value: unknown, body: AnyBody): AnimationInfo {
  const animation = value as AnimationInfo & { version?: number };
  if (animation?.version !== VERSION) bad('version');
  const { frames } = body;
  if (animation.fps !== body.fps) bad('fps');
  if (animation.num_frames !== frames) bad('num_frames');
  const { rest, min_speed: slowest, max_speed: fastest } = animation;
  const known = Number.isInteger(rest?.start) && Number.isInteger(rest.end);
  if (!known || rest.start < 0 || rest.start > rest.end || rest.end >= frames) bad('rest');
  if (!(Number.isFinite(slowest) && slowest > 0)) bad('min_speed');
  if (!(Number.isFinite(fastest) && fastest >= slowest)) bad('max_speed');
  return animation;
}

function bad(field: string): never {
  throw new PageError(`animation.json: ${field} is missing or does not fit the body.`);
}
