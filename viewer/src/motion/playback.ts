import type { Motion, Seen } from './motion.ts';

const LONGEST_STEP = 0.25; // s that may pass at once, e.g. after the page was hidden

/** A body alone on its time line: played forwards, at the end backwards, and so on. */
export class Playback implements Motion {
  time = 0; // s
  playing: boolean;
  readonly duration: number;
  private direction: 1 | -1 = 1;

  /** @param duration of the whole, s */
  constructor(duration: number, playing: boolean) {
    this.duration = duration;
    this.playing = playing;
  }

  stops(): number[] {
    return this.direction === 1 ? [this.duration, 0] : [0, this.duration];
  }

  advance(step: number, { waiting }: Seen): void {
    if (!this.playing || waiting) return;
    this.time += this.direction * Math.min(step, LONGEST_STEP);
    while (this.time < 0 || this.time > this.duration) {
      this.direction = this.time < 0 ? 1 : -1;
      this.time = this.time < 0 ? -this.time : 2 * this.duration - this.time;
    }
  }

  /** Goes to a time; plays on from there if it plays. */
  seek(seconds: number): void {
    this.time = Math.min(Math.max(seconds, 0), this.duration);
  }

  hold(seconds: number): void {
    this.playing = false;
    this.seek(seconds);
  }
}
