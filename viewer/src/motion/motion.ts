/** What is seen of the body: while a window is late it waits at a border, short of where it should be. */
export interface Seen {
  time: number; // s
  waiting: boolean;
}

/** Where the body is in its time, and where it goes. */
export interface Motion {
  readonly time: number; // s
  /** Times at which it will turn around or stand, in this order; it goes straight from one to the next. */
  stops(): number[];
  /** Goes on by `step` seconds. */
  advance(step: number, seen: Seen): void;
  /** Goes to a time and stays there. */
  hold(seconds: number): void;
}
