import type { Director } from '../head/head.ts';
import { smooth, type IdleFace } from './idle.ts';
import { mix, type ExpressionTrack } from './track.ts';

const EASE = 0.16; // s from one source of expressions to the next
/** What is drawn now lights the screen about one refresh later, s. */
export const DISPLAY_LEAD = 1 / 60;

/** An utterance that is heard now. */
export interface Heard {
  utterance: number;
  seconds: number; // of its sound, as it leaves the loudspeaker
  track: ExpressionTrack;
  paused?: boolean; // silent for a moment; it may go on
}

/** The face's one decision: speech while sound is heard, rest otherwise, eased between. Lids go on blinking. */
export class Face implements Director {
  private readonly idle: IdleFace;
  private readonly heard: () => Heard | null;
  private readonly clock: () => number;
  private source = -1; // utterance that is shown, -1 at rest
  private changedAt = -Infinity;
  private readonly from: Float32Array;
  private readonly target: Float32Array;
  private readonly awake: Float32Array; // without blinks
  private readonly shown: Float32Array;

  /**
   * @param heard what is heard now
   * @param clock seconds that only run forward
   */
  constructor(size: number, idle: IdleFace, heard: () => Heard | null, clock = () => performance.now() / 1000) {
    this.idle = idle;
    this.heard = heard;
    this.clock = clock;
    this.from = new Float32Array(size);
    this.target = new Float32Array(size);
    this.awake = new Float32Array(size);
    this.shown = new Float32Array(size);
    idle.rest(this.awake);
    idle.at(clock(), this.shown);
  }

  expression(out: Float32Array): boolean {
    const now = this.clock();
    const speech = this.heard();
    const heard = speech?.paused ? null : speech; // whoever falls silent closes the mouth
    const source = heard ? heard.utterance : -1;
    if (source !== this.source) {
      this.source = source;
      this.changedAt = now;
      this.from.set(this.awake);
    }
    if (heard) heard.track.at(heard.seconds + DISPLAY_LEAD, this.target);
    else this.idle.rest(this.target);
    mix(this.from, this.target, smooth((now - this.changedAt) / EASE), this.awake);
    this.shown.set(this.awake);
    this.idle.blinks(now, this.shown);
    const changed = this.shown.some((value, i) => value !== out[i]);
    out.set(this.shown);
    return changed;
  }
}
