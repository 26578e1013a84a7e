/** Which columns each worker draws, so that all of them take equally long. */
export class Bands {
  private borders: number[] = []; // columns; band i is from border i to border i + 1
  private readonly count: number;

  constructor(count: number) {
    this.count = count;
  }

  /** The bands of a picture of so many columns. */
  of(columns: number): [first: number, end: number][] {
    if (this.borders.at(-1) !== columns) {
      const before = this.borders.length ? this.borders.map((border) => border / this.borders.at(-1)!) : null;
      this.borders = Array.from({ length: this.count + 1 }, (_, i) => Math.round(columns * (before?.[i] ?? i / this.count)));
    }
    return this.borders.slice(1).map((end, i) => [this.borders[i]!, end]);
  }

  /** Moves the borders by what the bands took, where that differs much. */
  took(times: readonly number[]): void {
    const mean = times.reduce((sum, time) => sum + time, 0) / times.length;
    if (Math.max(...times) < UNEVEN * mean) return;
    const before = this.borders;
    this.borders = before.map((border, i) => {
      if (i === 0 || i === this.count) return border;
      const [faster, slower] = [times[i - 1]! < times[i]!, Math.abs(times[i - 1]! - times[i]!) / (times[i - 1]! + times[i]!)];
      const width = faster ? before[i + 1]! - border : border - before[i - 1]!;
      const way = Math.round(STEP * slower * width);
      return border + (faster ? way : -way);
    });
  }
}

/** How many workers may draw where each keeps so many bytes of what is drawn. */
export function workersFor(bytes: number): number {
  return Math.min(MOST_WORKERS, Math.max(1, Math.floor(MOST_BYTES / bytes)));
}

const MOST_WORKERS = 4;
const MOST_BYTES = 2 ** 28; // of all workers; for somebody with 100,000 Gaussians each has 2e7
const UNEVEN = 1.15; // the slowest band, of the mean
const STEP = 0.3; // share of the way to even bands, or they would swing
