import type { Timeline } from './timeline.ts';

/** What is fetched before it is needed. */
export interface Reach {
  ahead: number; // of the windows that come next
  beside: boolean; // whether the neighbours of the wanted window as well, in case of a change of way
  atOnce: number; // most fetches at the same time, however fast a visitor scrubs
}

/** For windows as people record them. */
export const FAR: Reach = { ahead: 2, beside: true, atOnce: 3 };
/** For windows so large that a page has no room for several. */
export const NEAR: Reach = { ahead: 1, beside: false, atOnce: 1 };
const RETRY = 2; // s after a failed fetch before the window is fetched again

/** One of the two places on the GPU that hold a window. */
export type Slot = 0 | 1;

/** What is drawn of the body. */
export interface Shown {
  time: number; // time of the body that is seen, s
  window: number; // index of the window that is seen
  slot: Slot; // slot that holds this window
  waiting: boolean; // whether the window of the wanted time is not there yet
}

/** Functions that the slots call. */
export interface SlotPorts<T> {
  /** Fetches and unpacks a window. */
  load(window: number): Promise<T>;
  /** Writes a window into a slot that is not seen. */
  put(slot: Slot, content: T): void;
  /** Whether everything that was put into a slot has been sorted, so that it may be seen. */
  settled(slot: Slot): boolean;
  /** Called when a window could not be fetched; it will be tried again. */
  failed(error: unknown): void;
}

/**
 * Decides which window is in which of two slots: one is seen while the other gets the next window.
 *
 * A slot is seen only when its window is loaded and sorted. Until then the seen slot stays, at the time
 * of its window that is nearest to the wanted time.
 */
export class Slots<T> {
  private readonly timeline: Timeline;
  private readonly ports: SlotPorts<T>;
  private readonly reach: Reach;
  private readonly held: [number | null, number | null] = [null, null]; // index of the window in each slot
  private readonly ready = new Map<number, T>();
  private readonly pending = new Set<number>();
  private readonly retryAt = new Map<number, number>();
  private seen: Slot | null = null;

  constructor(timeline: Timeline, reach: Reach, ports: SlotPorts<T>) {
    this.timeline = timeline;
    this.reach = reach;
    this.ports = ports;
  }

  /**
   * Decides what is seen of the body at a time, and fetches the windows that come next.
   *
   * @param time wanted time of the body, s
   * @param stops times at which the body will turn around or stand (`Motion.stops`), s
   * @param now time of a clock that only runs forward, s
   * @returns null until the first window is loaded and sorted
   */
  update(time: number, stops: readonly number[], now: number): Shown | null {
    const before = this.seen;
    const shown = this.show(time);
    const wanted = shown && !shown.waiting ? shown.window : this.timeline.windowAt(time);
    const order = this.order(wanted, stops);
    // After a change of slots the freed one is filled with the next picture: one picture never pays for both.
    if (this.seen === before) this.fill(shown && !shown.waiting ? order[1] : wanted);
    this.fetch(order, now);
    this.forget(order);
    return shown;
  }

  /** The window in a slot, null while it is empty. */
  windowIn(slot: Slot): number | null {
    return this.held[slot];
  }

  /** Windows in the order of fetching: the wanted one, the next ones on the body's way, perhaps neighbours of the wanted one. */
  private order(wanted: number, stops: readonly number[]): number[] {
    const { timeline, reach } = this;
    return [...new Set([wanted, ...timeline.route(wanted, stops, reach.ahead), ...(reach.beside ? timeline.beside(wanted) : [])])];
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
    const urgent = this.ready.has(order[0]!) ? order : order.slice(0, 1); // the wanted window gets all bandwidth
    for (const window of urgent) {
      const known = this.ready.has(window) || this.pending.has(window);
      if (known || this.pending.size >= this.reach.atOnce || now < (this.retryAt.get(window) ?? -Infinity)) continue;
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
