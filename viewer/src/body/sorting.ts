/** What a watch reads of Spark. */
export interface Sorter {
  readonly sorting: boolean; // whether a sort runs now
  readonly lastSortTime: number; // when the last sort began, ms of the performance clock
}

const FORGETS = 0.8; // factor by which a long time of sorting is forgotten with each later sort

/**
 * Tells when Spark has sorted a change: a sort that began with or after the first picture drawn since
 * the change must have ended.
 */
export class SortWatch {
  /** Recent time from the first picture after a change to the end of its sort, ms. */
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

  /** Must be called when Gaussians have changed. */
  changed(): void {
    this.drawnAt = this.sortedFrom = null;
    this.done = false;
  }

  /** Must be called before each picture is drawn; `now` in ms of the performance clock. */
  drawing(now: number): void {
    this.drawnAt ??= now;
    this.settled(); // called for each picture, so that no sort is missed and taken for a later one
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
