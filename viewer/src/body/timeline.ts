import type { BodyInfo } from '../bundle/manifest.ts';

/** The body's windows in seconds; a window begins at the time at which the one before ends. */
export class Timeline {
  readonly duration: number; // s
  private readonly borders: number[]; // s; window i is from border i to border i + 1

  constructor({ fps, windows }: Pick<BodyInfo, 'fps' | 'windows'>) {
    this.borders = [0, ...windows.map(({ last }) => last / fps)];
    this.duration = this.borders.at(-1)!;
  }

  get count(): number {
    return this.borders.length - 1;
  }

  /** Index of the window that shows a time; at a border that of the earlier window. */
  windowAt(seconds: number): number {
    const index = this.borders.findIndex((border, i) => i > 0 && seconds <= border) - 1;
    return index < 0 ? this.count - 1 : index;
  }

  contains(window: number, seconds: number): boolean {
    return seconds >= this.borders[window]! && seconds <= this.borders[window + 1]!;
  }

  /** The time of a window that is nearest to a time. */
  clamp(window: number, seconds: number): number {
    return Math.min(Math.max(seconds, this.borders[window]!), this.borders[window + 1]!);
  }

  /** Time τ within a window: 0 at its beginning, 1 at its end. */
  tau(window: number, seconds: number): number {
    const begin = this.borders[window]!;
    return (seconds - begin) / (this.borders[window + 1]! - begin);
  }

  /**
   * The next windows, at most `most`, that the body passes after a window.
   *
   * @param stops times at which the body turns around or stands, s; between two stops time runs in one direction
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
