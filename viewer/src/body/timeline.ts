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

  /** The window that is played `steps` after this one; at either end playback turns around. */
  ahead(window: number, direction: 1 | -1, steps: number): number {
    const last = this.count - 1;
    if (last === 0) return 0;
    let at = window + direction * steps;
    while (at < 0 || at > last) at = at < 0 ? -at : 2 * last - at;
    return at;
  }
}
