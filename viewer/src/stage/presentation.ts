import type { PerspectiveCamera } from 'three';
import type { Ground } from './camera/ground.ts';

/** A headset, or a phone held up, in which the stage is seen instead of on the page. */
export interface Presentation {
  readonly camera: PerspectiveCamera; // in the scene; three moves it to where the visitor's head is
  readonly passthrough: boolean; // the visitor's own room is seen around the avatar
  readonly ground: Ground;
  readonly stands: boolean; // the avatar, with feet that cast a shadow
  readonly rate: number; // pictures/s that are needed at least
  /**
   * A picture is about to be made, and where the visitor is in it is known.
   *
   * @param step seconds since the one before, 0 after a rest
   * @param pixels share of the pixels along a side that is to be drawn
   */
  frame(step: number, pixels: number): void;
}
