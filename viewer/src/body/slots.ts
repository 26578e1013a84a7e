import type { Timeline } from './timeline.ts';

const AHEAD = 2; // windows on the way that are fetched before they are needed
const MOST_AT_ONCE = 3; // fetches, however fast somebody scrubs
const RETRY = 2; // s after a window could not be fetched

/** One of the two places on the GPU that hold a window. */
export type Slot = 0 | 1;

/** What is drawn of the body. */
export interface Shown {
  time: number; // s: of what is seen
  window: number;
  slot: Slot;
  waiting: boolean; // for the window of the time that was asked for
}

/** What the slots need of the world. */
export interface SlotPorts<T> {
  /** Fetches and unpacks a window. */
  load(window: number): Promise<T>;
  /** Writes a window into a slot that is not seen. */
  put(slot: Slot, content: T): void;
  /** Whether everything that was put into a slot has been sorted, so that it may be seen. */
  settled(slot: Slot): boolean;
  /** A window could not be fetched; it will be tried again. */
  failed(error: unknown): void;
}

/**
 * Which window is where: one slot is seen while the other one gets the window that is played next.
 *
 * A slot is seen only once its window is there and sorted. Until then the other one stays, at the
 * moment of its window that is nearest to the time asked for.
 */
export class Slots<T> {
  private readonly timeline: Timeline;
  private readonly ports: SlotPorts<T>;
  private readonly held: [number | null, number | null] = [null, null]; // window in each slot
  private readonly ready = new Map<number, T>();
  private readonly pending = new Set<number>();
  private readonly retryAt = new Map<number, number>();
  private seen: Slot | null = null;

  constructor(timeline: Timeline, ports: SlotPorts<T>) {
    this.timeline = timeline;
    this.ports = ports;
  }

  /**
   * Decides what is seen of the body at a time, and gets what comes next.
   *
   * @param time s, of the body
   * @param stops s: the times at which the body will turn around or stand (`Motion.stops`)
   * @param now s, of a clock that only runs forward
   * @returns null until the first window is there
   */
  update(time: number, stops: readonly number[], now: number): Shown | null {
    const before = this.seen;
    const shown = this.show(time);
    const wanted = shown && !shown.waiting ? shown.window : this.timeline.windowAt(time);
    const order = this.order(wanted, stops);
    // What was seen until now goes one picture later, so that no picture has both to pay for.
    if (this.seen === before) this.fill(shown && !shown.waiting ? order[1] : wanted);
    this.fetch(order, now);
    this.forget(order);
    return shown;
  }

  /** The window in a slot, null while it is empty. */
  windowIn(slot: Slot): number | null {
    return this.held[slot];
  }

  /** Windows in the order in which to fetch them: the wanted one, those on the body's way, those beside the wanted one. */
  private order(wanted: number, stops: readonly number[]): number[] {
    const { timeline } = this;
    return [...new Set([wanted, ...timeline.route(wanted, stops, AHEAD), ...timeline.beside(wanted)])];
  }

  private show(time: number): Shown | null {
    if (this.seen === null || !this.holds(this.seen, time)) {
      const other = this.idle();
      if (this.holds(other, time) && this.ports.settled(other)) this.seen = other;
    }
    if (this.seen === null) return null;
    const window = this.held[this.seen]!;
    const waiting = !this.timeline.contains(window, time);
    return { time: this.timeline.clamp(window, time), window, slot: this.seen, waiting };
  }

  private holds(slot: Slot, time: number): boolean {
    const window = this.held[slot];
    return window !== null && this.timeline.contains(window, time);
  }

  private idle(): Slot {
    return this.seen === 0 ? 1 : 0;
  }

  /** Puts a window into the idle slot as soon as it has been fetched. */
  private fill(window: number | undefined): void {
    if (window === undefined || this.held.includes(window)) return;
    const content = this.ready.get(window);
    if (content === undefined) return;
    const slot = this.idle();
    this.held[slot] = window;
    this.ports.put(slot, content);
  }

  private fetch(order: number[], now: number): void {
    const urgent = this.ready.has(order[0]!) ? order : order.slice(0, 1); // all of the line for it
    for (const window of urgent) {
      const known = this.ready.has(window) || this.pending.has(window);
      if (known || this.pending.size >= MOST_AT_ONCE || now < (this.retryAt.get(window) ?? -Infinity)) continue;
      this.pending.add(window);
      this.ports
        .load(window)
        .then((content) => this.ready.set(window, content))
        .catch((error: unknown) => {
          this.retryAt.set(window, now + RETRY);
          this.ports.failed(error);
        })
        .finally(() => this.pending.delete(window));
    }
  }

  private forget(kept: number[]): void {
    for (const window of this.ready.keys()) if (!kept.includes(window)) this.ready.delete(window);
  }
}
