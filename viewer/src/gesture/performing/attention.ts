import type { StateMessage } from '../../protocol.ts';
import { chance } from '../noise.ts';

const RADIANS = Math.PI / 180;
const MOMENT = 0.35; // s for which somebody thinks before it is seen: a quick answer needs no look away
const ASIDE = 17 * RADIANS; // how far who thinks looks past the visitor
const UPWARDS = 8 * RADIANS;
const TILT = 5 * RADIANS; // of the head of who listens

/** How a head is held besides towards the visitor, radians: to the person's left, downwards, and tilted to the left. */
export interface Bearing {
  yaw: number;
  pitch: number;
  tilt: number;
}

/** What shows on a head that somebody listens (it tilts), or thinks (it looks past the visitor, and up). */
export class Attention {
  private readonly seed: number;
  private state: StateMessage['state'] = 'idle';
  private since = 0; // s
  private changes = 0;

  /** @param seed whole number, which decides on sides */
  constructor(seed: number) {
    this.seed = seed;
  }

  /** From a time on, s, the person does this. */
  attend(state: StateMessage['state'], time: number): void {
    if (state === this.state) return;
    this.state = state;
    this.since = time;
    this.changes++;
  }

  /** How the head is held at a time, s. */
  at(time: number): Bearing {
    const side = chance(this.seed, this.changes, 2) < 0.5 ? -1 : 1;
    const thinks = this.state === 'thinking' && time - this.since >= MOMENT;
    const [yaw, pitch] = thinks ? [side * ASIDE, -UPWARDS] : [0, 0];
    return { yaw, pitch, tilt: this.state === 'listening' ? side * TILT : 0 };
  }
}
