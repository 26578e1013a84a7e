import type { Message } from '../words/text.ts';

/** What drawing takes, for the panel. */
export interface Figures {
  drawn: Message; // what draws, and why it does
  frames: number; // drawn so far
  evaluation: number; // ms of a picture: who moves, and how
  sort: number; // ms of the last sort: beside the pictures by WebGL, a part of drawing by the processor
  draw: number; // ms of a picture, until the GPU has all orders or the processor has drawn it
  gaussians: number; // drawn
  level: number; // of quality, 1 the best
  levels: number;
  pixels: [number, number];
  bytes: number; // of the bundle that came before there was somebody to see
}

const SHARE = 0.1; // of a new value in a mean that forgets

/** A mean of what was measured last. */
export class Mean {
  value = 0;
  private any = false;

  add(value: number): void {
    this.value = this.any ? this.value + SHARE * (value - this.value) : value;
    this.any = true;
  }
}
