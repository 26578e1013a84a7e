import { BEAT_SECONDS } from '../../protocol.ts';

const LOOK = (1000 * BEAT_SECONDS) / 2; // ms between looks
const MOST_LOOKS = 8; // four beats that did not come

/**
 * Notices that a line which beats has fallen silent.
 *
 * It counts its own looks, not the time: a page that slept, or a tab that was busy, looks once
 * when it wakes, and what had come meanwhile is heard before the next look.
 */
export class Silence {
  private readonly fell: () => void;
  private looks = 0; // since something was heard
  private timer: ReturnType<typeof setTimeout> | undefined;

  /** @param fell the line has said nothing for some seconds; once, until it is heard again */
  constructor(fell: () => void) {
    this.fell = fell;
  }

  /** Something came over the line, which beats from now on. */
  heard(): void {
    this.looks = 0;
    this.timer ??= setTimeout(() => this.look(), LOOK);
  }

  /** The line is down: nothing is expected. */
  end(): void {
    clearTimeout(this.timer);
    this.timer = undefined;
  }

  private look(): void {
    this.timer = undefined;
    if (++this.looks >= MOST_LOOKS) return this.fell();
    this.timer = setTimeout(() => this.look(), LOOK);
  }
}
