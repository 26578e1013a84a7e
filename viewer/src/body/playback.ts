/** Where the body is on its time line: played forwards, at the end backwards, and so on. */
export class Playback {
  time = 0; // s
  playing: boolean;
  direction: 1 | -1 = 1;
  private readonly duration: number;

  /** @param duration of the whole, s */
  constructor(duration: number, playing: boolean) {
    this.duration = duration;
    this.playing = playing;
  }

  /** Goes on by `step` seconds, if it plays. */
  advance(step: number): void {
    if (!this.playing) return;
    this.time += this.direction * step;
    while (this.time < 0 || this.time > this.duration) {
      this.direction = this.time < 0 ? 1 : -1;
      this.time = this.time < 0 ? -this.time : 2 * this.duration - this.time;
    }
  }

  /** Goes to a time. */
  seek(seconds: number): void {
    this.time = Math.min(Math.max(seconds, 0), this.duration);
  }
}
