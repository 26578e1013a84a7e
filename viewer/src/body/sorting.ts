/** What a watch asks Spark: whether a sort runs now, and when the last one began (ms, performance clock). */
export interface Sorter {
  readonly sorting: boolean;
  readonly lastSortTime: number;
}

const FORGETS = 0.8; // of how long a sort took, with every later one

/**
 * Tells when what was changed has been sorted: a sort must begin with or after the first picture
 * that is drawn since, and end.
 */
export class SortWatch {
  /** How long it took lately from the first picture after a change until the sort of it had ended, ms. */
  took = Infinity;
  private readonly sorter: Sorter;
  private readonly now: () => number;
  private drawnAt: number | null = null;
  private sortedFrom: number | null = null;
  private done = true;

  constructor(sorter: Sorter, now = () => performance.now()) {
    this.sorter = sorter;
    this.now = now;
  }

  /** Something was changed. */
  changed(): void {
    this.drawnAt = this.sortedFrom = null;
    this.done = false;
  }

  /** A picture is about to be drawn; `now` in ms, performance clock. */
  drawing(now: number): void {
    this.drawnAt ??= now;
    this.settled(); // looks at each sort, or one that has ended would be taken for the next one
  }

  /** Whether the last change has been sorted. */
  settled(): boolean {
    if (this.done || this.drawnAt === null) return this.done;
    const { sorting, lastSortTime } = this.sorter;
    if (this.sortedFrom === null && lastSortTime >= this.drawnAt) this.sortedFrom = lastSortTime;
    this.done = this.sortedFrom !== null && (!sorting || lastSortTime > this.sortedFrom);
    if (this.done) this.took = Math.max(this.now() - this.drawnAt, this.took < Infinity ? FORGETS * this.took : 0);
    return this.done;
  }
}
