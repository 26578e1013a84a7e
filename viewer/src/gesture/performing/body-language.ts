import { DISPLAY_LEAD } from '../../face/face.ts';
import type { Spoken } from '../../motion/director.ts';
import { MICROPHONE_RATE, type Cue, type StateMessage } from '../../protocol.ts';
import type { Vector } from '../../rig/quaternions.ts';
import type { Rig } from '../../rig/rig.ts';
import type { Figure } from '../figure.ts';
import { Living } from '../living.ts';
import type { RigPose } from '../placement.ts';
import type { Repertoire } from '../repertoire.ts';
import { Retarget } from '../retarget.ts';
import { Attention } from './attention.ts';
import { roundedRelease, type Direction } from './cues.ts';
import { directionTo, Gaze } from './gaze.ts';
import { Listener, Loudness } from './listening.ts';
import { Performer, type Clock } from './performer.ts';

/** Utterances that wait to be heard; of more, the first is stopped. */
const MOST_CLOCKS = 100;

/**
 * Poses a person's rig: the person stands, looks at the visitor, nods, and gestures as the server directs.
 *
 * Times of directions are seconds of their utterance. While the utterance is heard, its sound is the clock:
 * gestures stay on the accents of speech, and stand still while it is paused. Afterwards the page's clock
 * takes over.
 */
export class BodyLanguage {
  private readonly heard: () => Spoken | null;
  private readonly pivot: Vector; // at the height of the eyes, over the joint about which the face turns, m in rest space
  private readonly retarget: Retarget;
  private readonly performer: Performer;
  private readonly gaze = new Gaze();
  private readonly attention: Attention;
  private readonly listener: Listener;
  private readonly loudness = new Loudness(MICROPHONE_RATE);
  private readonly own: Clock = { offset: 0 }; // clock of gestures that the page itself decides on
  private clocks = new Map<number, Clock>(); // clock of each utterance
  private made = 0; // number of such gestures so far
  private now = 0; // time of the page, s

  /**
   * @param seed whole number, seed of all random movements
   * @param heard returns what is heard now: the utterance and its second; null in silence
   */
  constructor(rig: Rig, { figure, clips }: Repertoire, seed: number, heard: () => Spoken | null) {
    this.heard = heard;
    this.pivot = pivotOf(rig, figure);
    this.retarget = new Retarget(rig, figure);
    this.performer = new Performer(new Living(figure, seed), clips);
    this.attention = new Attention(seed);
    this.listener = new Listener(seed);
  }

  /** Adds directions of the server for an utterance. */
  plan(utterance: number, directions: readonly Direction[]): void {
    this.performer.follow(directions, this.clock(utterance));
  }

  /** Ends an interrupted utterance: hands come down after the stroke that they have begun. */
  stop(utterance: number): void {
    const clock = this.clocks.get(utterance);
    if (clock) this.performer.stop(clock, this.now);
    this.clocks.delete(utterance);
  }

  /** Stops all utterances, as a new session numbers them from 0 again. */
  reset(): void {
    for (const utterance of [...this.clocks.keys()]) this.stop(utterance);
    this.attend('idle');
  }

  /** Sets the position of the visitor, m in rest space. */
  look(visitor: Vector): void {
    const [yaw, pitch] = directionTo(this.pivot, visitor);
    this.gaze.look(yaw, pitch, this.attention.at(this.now));
  }

  /** Shows from now on that the person listens, thinks, or does neither. */
  attend(state: StateMessage['state']): void {
    this.attention.attend(state, this.now);
  }

  /** Takes sound of the visitor (int16 at MICROPHONE_RATE); after phrases the person may nod, unless speaking. */
  listen(pcm: Int16Array): void {
    for (const [, name] of this.listener.hear(this.loudness.push(pcm))) if (!this.heard()) this.make(name);
  }

  /** Advances the time of the page by `step` seconds. */
  advance(step: number): void {
    this.now += step;
    const heard = this.heard();
    if (heard) {
      this.leaveUnheard(heard.utterance);
      this.clock(heard.utterance).offset = this.now - (heard.seconds + DISPLAY_LEAD);
    }
    this.performer.tidy(this.now);
  }

  /** The pose of the rig now. */
  pose(): RigPose {
    const { pose, root } = this.performer.at(this.now, this.gaze.at(this.now));
    return { rotations: this.retarget.pose(pose), root };
  }

  private clock(utterance: number): Clock {
    const clock = this.clocks.get(utterance) ?? { offset: Infinity };
    this.clocks.set(utterance, clock);
    if (this.clocks.size > MOST_CLOCKS) this.stop(this.clocks.keys().next().value!);
    return clock;
  }

  /** Removes the clocks of earlier utterances, which will not be heard any more; unheard ones are stopped. */
  private leaveUnheard(utterance: number): void {
    for (const [earlier, { offset }] of [...this.clocks]) {
      if (earlier >= utterance) continue;
      if (offset === Infinity) this.stop(earlier);
      else this.clocks.delete(earlier); // gestures that have begun go on to their ends
    }
  }

  /** Makes a gesture from now on, at the pace of its clip; false if there is none of that name. */
  make(name: string): boolean {
    const clip = this.performer.clip(name);
    if (!clip) return false;
    const cue: Cue = { number: this.made++, name, mirror: false, begin: this.now, stroke: this.now + clip.marks.stroke, skip: 0 };
    const release = { number: cue.number, time: roundedRelease(clip, cue, cue.stroke) };
    this.performer.follow([cue, release], this.own);
    return true;
  }
}

/** The face turns about the neck: seen from the eyes, which come along, whoever is near would stand further aside. */
function pivotOf({ joints }: Rig, { eyes, parts }: Figure): Vector {
  const neck = parts.find(({ role }) => role === 'neck') ?? parts.find(({ role }) => role === 'head');
  return neck ? [eyes[0], eyes[1], joints[neck.joints[0]!]![2]] : eyes;
}
