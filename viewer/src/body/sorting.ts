/** Of Spark: whether it sorts, and when the last sort began (ms, performance clock). */
export interface Sorter {
  readonly sorting: boolean;
  readonly lastSortTime: number;
}

/**
 * Tells when what was changed has been sorted: a sort must begin with or after the first picture
 * that is drawn since, and end.
 */
export class SortWatch {
  private readonly sorter: Sorter;
  private drawnAt: number | null = null;
  private sortedFrom: number | null = null;
  private done = true;

  constructor(sorter: Sorter) {
    this.sorter = sorter;
  }

  /** Something was changed. */
  changed(): void {
    this.drawnAt = this.sortedFrom = null;
    this.done = false;
  }

  /** A picture is about to be drawn; `now` in ms, performance clock. */
  drawing(now: number): void {
    this.drawnAt ??= now;
  }

  /** Whether the last change has been sorted. */
  settled(): boolean {
    if (this.done || this.drawnAt === null) return this.done;
    const { sorting, lastSortTime } = this.sorter;
    if (this.sortedFrom === null && lastSortTime >= this.drawnAt) this.sortedFrom = lastSortTime;
    this.done = this.sortedFrom !== null && (!sorting || lastSortTime > this.sortedFrom);
    return this.done;
  }
}
