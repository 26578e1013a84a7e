import type { BodyInfo } from '../bundle/manifest.ts';

/** The body's windows in seconds; neighbours share the moment at which one follows the other. */
export class Timeline {
  readonly duration: number; // s
  private readonly borders: number[]; // s: window i lies from border i to border i + 1

  constructor({ fps, windows }: Pick<BodyInfo, 'fps' | 'windows'>) {
    this.borders = [0, ...windows.map(({ last }) => last / fps)];
    this.duration = this.borders.at(-1)!;
  }

  get count(): number {
    return this.borders.length - 1;
  }

  /** The window of a time; where two meet, the earlier one. */
  windowAt(seconds: number): number {
    const index = this.borders.findIndex((border, i) => i > 0 && seconds <= border) - 1;
    return index < 0 ? this.count - 1 : index;
  }

  contains(window: number, seconds: number): boolean {
    return seconds >= this.borders[window]! && seconds <= this.borders[window + 1]!;
  }

  /** The nearest time of a window. */
  clamp(window: number, seconds: number): number {
    return Math.min(Math.max(seconds, this.borders[window]!), this.borders[window + 1]!);
  }

  /** 0 at the window's begin, 1 at its end. */
  tau(window: number, seconds: number): number {
    const begin = this.borders[window]!;
    return (seconds - begin) / (this.borders[window + 1]! - begin);
  }

  /**
   * The windows that follow a window, at most `most`, on the way from stop to stop.
   *
   * @param stops s: times at which the body turns around or stands; from one to the next it goes straight
   */
  route(window: number, stops: readonly number[], most: number): number[] {
    const route: number[] = [];
    let at = window;
    for (const stop of stops) {
      while (!this.contains(at, stop) && route.length < most) {
        at += stop > this.borders[at]! ? 1 : -1;
        route.push(at);
      }
    }
    return route;
  }

  /** The windows beside a window. */
  beside(window: number): number[] {
    return [window + 1, window - 1].filter((at) => at >= 0 && at < this.count);
  }
}
