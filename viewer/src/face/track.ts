import type { Matrix } from '../protocol.ts';

/** Numbers that are kept: an hour of a face has a tenth of them. */
const MOST_VALUES = 1 << 25;

/** The expressions of one utterance: row j belongs to j / fps seconds of its sound. */
export class ExpressionTrack {
  private readonly rows: Float32Array[] = [];
  private readonly fps: number;
  private kept = 0; // numbers
  private first = Infinity; // row that is known; a page may join an utterance late

  constructor(fps: number) {
    this.fps = fps;
  }

  /** Adds rows from index `first` on; none that leave a gap, which no server does that keeps to the protocol. */
  add(first: number, { rows, columns, values }: Matrix): void {
    if (!this.empty && (first > this.rows.length || first + rows < this.first)) return;
    this.kept += values.length;
    if (this.kept > MOST_VALUES) return;
    this.first = Math.min(this.first, first);
    for (let i = 0; i < rows; i++) this.rows[first + i] = values.subarray(i * columns, (i + 1) * columns);
  }

  get empty(): boolean {
    return this.rows.length === 0;
  }

  /** The expression at a time of the sound, between rows linearly, held beyond the ends. */
  at(seconds: number, out: Float32Array): void {
    const last = this.rows.length - 1;
    const row = Math.min(Math.max(seconds * this.fps, this.first), last);
    const index = Math.floor(row);
    const before = this.rows[index]!;
    const after = this.rows[Math.min(index + 1, last)]!;
    mix(before, after, row - index, out);
  }
}

/** out = before + (after − before) · fraction. */
export function mix(before: Float32Array, after: Float32Array, fraction: number, out: Float32Array): void {
  for (let i = 0; i < out.length; i++) out[i] = before[i]! + (after[i]! - before[i]!) * fraction;
}
