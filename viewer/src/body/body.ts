import type { Actor } from '../actor.ts';
import type { BodyInfo } from '../bundle/manifest.ts';
import type { Motion } from '../motion/motion.ts';
import { WindowGenerator } from './generator.ts';
import { capacityOf, pack, texelsOf, type PackedWindow } from './packed.ts';
import { FAR, NEAR, Slots, type Shown, type Slot } from './slots.ts';
import { SortWatch, type Sorter } from './sorting.ts';
import type { Timeline } from './timeline.ts';
import type { BakedWindow } from './window.ts';

const SLOTS = [0, 1] as const;
const POLL = 10; // ms
const WAKE = 0.25; // least time before a window may be seen from which on it takes part in sorting, s
const LARGE = 2 ** 21; // texels, of 8 bytes and more, of which a page has no room for several windows
const MARGIN = 3; // number of sorts for which that time must suffice: a busy device sometimes takes longer

/** Functions of the page that the body calls. */
export interface BodyPorts {
  /** Fetches a window. */
  load(window: number): Promise<BakedWindow>;
  /** Called when a window could not be fetched. */
  failed(error: unknown): void;
}

/** A body of windows on stage: while it moves, its windows are loaded into two slots in turn. */
export class Body implements Actor {
  readonly objects: [WindowGenerator, WindowGenerator];
  readonly motion: Motion;
  /** What the next picture shows of the body; null until its first window is loaded and sorted. */
  shown: Shown | null = null;
  private readonly means: [Float32Array | null, Float32Array | null] = [null, null]; // of the windows in the slots
  private failure: unknown = null;
  private readonly timeline: Timeline;
  private readonly slots: Slots<PackedWindow>;
  private readonly watches: [SortWatch, SortWatch];

  constructor(info: BodyInfo, timeline: Timeline, motion: Motion, sorter: Sorter, ports: BodyPorts) {
    const capacity = capacityOf(info);
    this.timeline = timeline;
    this.motion = motion;
    this.objects = [new WindowGenerator(capacity), new WindowGenerator(capacity)];
    this.watches = [new SortWatch(sorter), new SortWatch(sorter)];
    const reach = texelsOf(capacity) > LARGE ? NEAR : FAR;
    this.slots = new Slots(this.timeline, reach, {
      load: async (window) => pack(await ports.load(window), capacity),
      put: (slot, content) => this.put(slot, content),
      settled: (slot) => this.objects[slot].awake && this.watches[slot].settled(),
      failed: (error) => {
        this.failure = error;
        ports.failed(error);
      },
    });
  }

  tick(step: number): boolean {
    const { motion } = this;
    if (this.shown) motion.advance(step, this.shown);
    this.shown = this.slots.update(motion.time, motion.stops(), performance.now() / 1000);
    return SLOTS.map((slot) => this.pose(slot)).includes(true);
  }

  /** Of the window that is seen, where its Gaussians are on the whole. */
  get points(): Float32Array | null {
    return this.shown && this.means[this.shown.slot];
  }

  /** Time of the body that the picture shows, s. */
  get time(): number {
    return this.shown?.time ?? this.motion.time;
  }

  drawing(now: number): void {
    for (const watch of this.watches) watch.drawing(now);
  }

  /**
   * Resolves when the picture shows the time of the motion.
   *
   * @throws the error with which the first window could not be fetched
   */
  async ready(): Promise<void> {
    while (this.shown?.time !== this.motion.time) {
      if (!this.shown && this.failure) throw this.failure;
      await new Promise((resolve) => setTimeout(resolve, POLL));
    }
  }

  /** Goes to a time and stays there; resolves when the picture shows it. The stage must be running. */
  async show(seconds: number): Promise<void> {
    this.motion.hold(seconds);
    await this.ready();
  }

  /** Seconds before a window may be seen from which on it takes part in sorting. */
  private get soon(): number {
    const sorts = Math.max(...this.watches.map(({ took }) => took));
    return Math.max(WAKE, (MARGIN * sorts) / 1000);
  }

  private put(slot: Slot, content: PackedWindow): void {
    this.objects[slot].hold(content);
    this.means[slot] = content.means;
  }

  /**
   * Poses the window in a slot: a seen one at the shown time, a hidden one as it will be when it appears.
   *
   * @returns whether anything changed
   */
  private pose(slot: Slot): boolean {
    const window = this.slots.windowIn(slot);
    if (window === null) return false;
    const object = this.objects[slot];
    const seen = this.shown?.slot === slot;
    const time = this.timeline.clamp(window, this.motion.time);
    if (!seen && Math.abs(this.motion.time - time) > this.soon) return object.sleep();
    if (!object.awake) this.watches[slot].changed();
    return object.pose(this.timeline.tau(window, seen ? this.shown!.time : time), seen);
  }
}
