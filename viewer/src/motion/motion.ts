/** Where the body is in its time, and where it goes. */
export interface Motion {
  readonly time: number; // s
  /** Times at which it will turn around or stand, in this order; it goes straight from one to the next. */
  stops(): number[];
  /** Goes on by `step` seconds. */
  advance(step: number): void;
  /** Goes to a time and stays there. */
  hold(seconds: number): void;
}
