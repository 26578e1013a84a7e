import type { AnimationInfo } from '../bundle/animation.ts';
import { DISPLAY_LEAD } from '../face/face.ts';
import { clamp, Glide } from './glide.ts';
import type { Motion, Seen } from './motion.ts';
import { SpeechPath } from './path.ts';

/** Utterances whose plans are kept: one is heard, and the next ones wait. */
const MOST_PLANS = 64;

/** An utterance that is heard now. */
export interface Spoken {
  utterance: number;
  seconds: number; // of its sound, as it leaves the loudspeaker
  paused?: boolean; // silent for a moment; it may go on
}

/**
 * Moves the body of a whole person: a rest loop in silence, while it speaks what the server planned.
 *
 * A plan is followed on the clock of the sound, so gestures and words cannot drift apart. From
 * wherever the body is it gets to the plan, and back to the rest loop, along captured frames and
 * within the speed that the animation allows. What comes late is caught up with, never jumped to.
 */
export class MotionDirector implements Motion {
  private readonly heard: () => Spoken | null;
  private readonly start: number; // s, of the rest loop
  private readonly end: number;
  private readonly last: number; // s, of the recording
  private readonly cruise: number; // captured speed, as far as it is allowed
  private readonly limit: number;
  private readonly glide: Glide;
  private readonly paths = new Map<number, SpeechPath>();
  private speaking: Spoken | null = null; // with a plan
  private direction: 1 | -1 = 1; // in the rest loop
  private held = false;

  /** @param heard what is heard now */
  constructor(info: AnimationInfo, heard: () => Spoken | null) {
    this.heard = heard;
    this.start = info.rest.start / info.fps;
    this.end = info.rest.end / info.fps;
    this.last = (info.num_frames - 1) / info.fps;
    this.cruise = clamp(1, info.min_speed, info.max_speed);
    this.limit = info.max_speed;
    this.glide = new Glide(this.start);
  }

  get time(): number {
    return clamp(this.glide.time, 0, this.last);
  }

  /** Takes what the server planned for an utterance, or more of it. */
  plan(utterance: number, points: readonly [number, number][]): void {
    if (points.length === 0) return;
    const path = this.paths.get(utterance) ?? new SpeechPath();
    path.add(points.map(([sound, body]) => [sound, clamp(body, 0, this.last)]));
    this.paths.set(utterance, path);
    if (this.paths.size > MOST_PLANS) this.paths.delete(this.paths.keys().next().value!);
  }

  /** Drops all plans: a new session counts its utterances from 0. */
  reset(): void {
    this.paths.clear();
  }

  stops(): number[] {
    if (this.held) return [];
    if (!this.speaking) return this.direction === 1 ? [this.end, this.start] : [this.start, this.end];
    const { utterance, seconds } = this.speaking;
    const path = this.paths.get(utterance);
    return path ? [path.at(seconds).time, ...path.after(seconds), this.end] : [this.end];
  }

  advance(step: number, seen: Seen): void {
    if (this.held) return;
    if (seen.waiting) this.glide.time = seen.time; // from there it goes on, or it would jump
    const heard = this.heard();
    const path = heard && this.paths.get(heard.utterance);
    if (path) this.speak(path, { ...heard, seconds: heard.seconds + DISPLAY_LEAD }, step);
    else this.rest(step);
  }

  hold(seconds: number): void {
    this.held = true;
    this.glide.time = clamp(seconds, 0, this.last);
  }

  private speak(path: SpeechPath, spoken: Spoken, step: number): void {
    if (this.speaking?.utterance !== spoken.utterance) this.begin(spoken.utterance);
    this.speaking = spoken;
    const { time, pace } = path.at(spoken.seconds);
    this.glide.follow(time, spoken.paused ? 0 : pace, this.limit, step);
  }

  /** Begins an utterance: plans of earlier ones are dropped, for those will not be heard any more. */
  private begin(utterance: number): void {
    this.glide.leave();
    for (const old of this.paths.keys()) if (old < utterance) this.paths.delete(old);
  }

  private rest(step: number): void {
    if (this.speaking) this.calm();
    const target = this.direction === 1 ? this.end : this.start;
    if (!this.glide.follow(target, 0, this.cruise, step)) return;
    this.direction = this.direction === 1 ? -1 : 1;
    this.glide.stand();
  }

  /** Goes back from a gesture into the rest loop, at first towards the loop's end that lies farther away. */
  private calm(): void {
    this.speaking = null;
    this.glide.leave();
    if (this.time > this.end) this.direction = -1;
    else if (this.time < this.start) this.direction = 1;
    else this.direction = this.glide.velocity < 0 ? -1 : 1;
  }
}
