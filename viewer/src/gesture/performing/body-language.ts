import { DISPLAY_LEAD } from '../../face/face.ts';
import type { Spoken } from '../../motion/director.ts';
import { MICROPHONE_RATE, type Cue } from '../../protocol.ts';
import type { Vector } from '../../rig/quaternions.ts';
import type { Rig } from '../../rig/rig.ts';
import { Living } from '../living.ts';
import type { RigPose } from '../placement.ts';
import type { Repertoire } from '../repertoire.ts';
import { Retarget } from '../retarget.ts';
import { roundedRelease, type Direction } from './cues.ts';
import { directionTo, Gaze } from './gaze.ts';
import { Listener, Loudness } from './listening.ts';
import { Performer, type Clock } from './performer.ts';

/**
 * Moves somebody's rig: they stand, look at the visitor, nod, and gesture as the server directs.
 *
 * Directions count the seconds of their utterance. While it is heard these are the seconds of its sound,
 * so gestures stay on its accents and stand still where it pauses; afterwards they go on with the page.
 */
export class BodyLanguage {
  private readonly heard: () => Spoken | null;
  private readonly eyes: Vector;
  private readonly retarget: Retarget;
  private readonly performer: Performer;
  private readonly gaze = new Gaze();
  private readonly listener: Listener;
  private readonly loudness = new Loudness(MICROPHONE_RATE);
  private readonly own: Clock = { offset: 0 }; // of what the page decides itself
  private clocks = new Map<number, Clock>(); // by utterance
  private nods = 0;
  private now = 0; // s of the page

  /**
   * @param seed a whole number that decides all that is by chance
   * @param heard what is heard now
   */
  constructor(rig: Rig, { figure, clips }: Repertoire, seed: number, heard: () => Spoken | null) {
    this.heard = heard;
    this.eyes = figure.eyes;
    this.retarget = new Retarget(rig, figure);
    this.performer = new Performer(new Living(figure, seed), clips);
    this.listener = new Listener(seed);
  }

  /** Takes what the server directs for an utterance, or more of it. */
  plan(utterance: number, directions: readonly Direction[]): void {
    this.performer.follow(directions, this.clock(utterance));
  }

  /** An utterance was interrupted: hands come down once their stroke has arrived. */
  stop(utterance: number): void {
    const clock = this.clocks.get(utterance);
    if (clock) this.performer.stop(clock, this.now);
    this.clocks.delete(utterance);
  }

  /** Stops all utterances: a new session counts them from 0. */
  reset(): void {
    for (const utterance of [...this.clocks.keys()]) this.stop(utterance);
  }

  /** The visitor is there, m in rest space. */
  look(visitor: Vector): void {
    this.gaze.look(...directionTo(this.eyes, visitor));
  }

  /** Sound of the visitor; while nobody else speaks, phrases of it get nods. */
  listen(pcm: Int16Array): void {
    for (const [, name] of this.listener.hear(this.loudness.push(pcm))) if (!this.heard()) this.nod(name);
  }

  /** Goes on by `step` seconds. */
  advance(step: number): void {
    this.now += step;
    const heard = this.heard();
    if (heard) {
      this.leaveUnheard(heard.utterance);
      this.clock(heard.utterance).offset = this.now - (heard.seconds + DISPLAY_LEAD);
    }
    this.performer.tidy(this.now);
  }

  /** How the rig is posed now. */
  pose(): RigPose {
    const { pose, root } = this.performer.at(this.now, this.gaze.at(this.now));
    return { rotations: this.retarget.pose(pose), root };
  }

  private clock(utterance: number): Clock {
    const clock = this.clocks.get(utterance) ?? { offset: Infinity };
    this.clocks.set(utterance, clock);
    return clock;
  }

  /** Utterances before the one that is heard now will not be heard any more. */
  private leaveUnheard(utterance: number): void {
    for (const [earlier, { offset }] of [...this.clocks]) {
      if (earlier >= utterance) continue;
      if (offset === Infinity) this.stop(earlier);
      else this.clocks.delete(earlier); // its gestures go on to their ends
    }
  }

  /** A gesture without words, as it was made, from now on. */
  private nod(name: string): void {
    const clip = this.performer.clip(name);
    if (!clip) return;
    const cue: Cue = { number: this.nods++, name, mirror: false, begin: this.now, stroke: this.now + clip.marks.stroke, skip: 0 };
    const release = { number: cue.number, time: roundedRelease(clip, cue, cue.stroke) };
    this.performer.follow([cue, release], this.own);
  }
}
