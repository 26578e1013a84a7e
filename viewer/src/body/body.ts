import type { BodyInfo } from '../bundle/manifest.ts';
import type { Actor } from '../stage/stage.ts';
import { WindowGenerator } from './generator.ts';
import { capacityOf, pack, type PackedWindow } from './packed.ts';
import { Playback } from './playback.ts';
import { Slots, type Shown, type Slot } from './slots.ts';
import { SortWatch, type Sorter } from './sorting.ts';
import { Timeline } from './timeline.ts';
import type { BakedWindow } from './window.ts';

const SLOTS = [0, 1] as const;
const POLL = 10; // ms

/** What the body needs of the page around it. */
export interface BodyPorts {
  /** Fetches a window. */
  load(window: number): Promise<BakedWindow>;
  /** A window could not be fetched. */
  failed(error: unknown): void;
}

/** The body on stage: its windows come and go in two slots while it plays. */
export class Body implements Actor {
  readonly objects: [WindowGenerator, WindowGenerator];
  readonly playback: Playback;
  readonly timeline: Timeline;
  /** What the next picture shows of the body; null until its first window is there. */
  shown: Shown | null = null;
  private failure: unknown = null;
  private readonly slots: Slots<PackedWindow>;
  private readonly watches: [SortWatch, SortWatch];

  constructor(info: BodyInfo, playing: boolean, sorter: Sorter, ports: BodyPorts) {
    const capacity = capacityOf(info);
    this.timeline = new Timeline(info);
    this.playback = new Playback(this.timeline.duration, playing);
    this.objects = [new WindowGenerator(capacity), new WindowGenerator(capacity)];
    this.watches = [new SortWatch(sorter), new SortWatch(sorter)];
    this.slots = new Slots(this.timeline, {
      load: async (window) => pack(await ports.load(window), capacity),
      put: (slot, content) => this.put(slot, content),
      settled: (slot) => this.watches[slot].settled(),
      failed: (error) => {
        this.failure = error;
        ports.failed(error);
      },
    });
  }

  tick(step: number): boolean {
    if (this.shown && !this.shown.waiting) this.playback.advance(step);
    const { time, direction } = this.playback;
    this.shown = this.slots.update(time, direction, performance.now() / 1000);
    return SLOTS.map((slot) => this.pose(slot)).includes(true);
  }

  drawing(now: number): void {
    for (const watch of this.watches) watch.drawing(now);
  }

  /**
   * Resolves when what was asked for is on stage.
   *
   * @throws whatever kept the first window from being fetched
   */
  async ready(): Promise<void> {
    while (!this.shown || this.shown.waiting) {
      if (!this.shown && this.failure) throw this.failure;
      await new Promise((resolve) => setTimeout(resolve, POLL));
    }
  }

  /** Goes to a time and stays there; resolves when it is on stage. */
  async show(seconds: number): Promise<void> {
    this.playback.playing = false;
    this.playback.seek(seconds);
    this.tick(0);
    await this.ready();
  }

  private put(slot: Slot, content: PackedWindow): void {
    this.objects[slot].hold(content);
    this.watches[slot].changed();
  }

  /** The slot that is not seen waits where it will appear: at its end next to the present. */
  private pose(slot: Slot): boolean {
    const window = this.slots.windowIn(slot);
    if (window === null) return false;
    const time = this.timeline.clamp(window, this.playback.time);
    const tau = this.timeline.tau(window, this.shown?.slot === slot ? this.shown.time : time);
    return this.objects[slot].pose(tau, this.shown?.slot === slot);
  }
}
