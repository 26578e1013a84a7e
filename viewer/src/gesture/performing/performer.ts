import { multiply, slerp, type Quat } from '../../rig/quaternions.ts';
import type { Cue } from '../../protocol.ts';
import { ROLES } from '../../shared.ts';
import type { Clip } from '../clip.ts';
import type { Living, Moment } from '../living.ts';
import { indexOf } from '../roles.ts';
import { power } from '../turning.ts';
import { clipTime, endOf, isCue, roundedRelease, weight, type Direction } from './cues.ts';

/** Roles whose gestures come upon what the rest does; those of the others replace it. */
const ADDED = ROLES.map((role) => /^(hips|spine|chest|neck|head|.*_clavicle)$/.test(role));
const TURNED = (['chest', 'neck', 'head'] as const).map(indexOf);

/** The time of an utterance. */
export interface Clock {
  offset: number; // the page's second at which its second 0 is; infinite until it begins
}

/** A cue that was taken on. */
interface Taken {
  cue: Cue;
  clip: Clip;
  clock: Clock;
  release: number | null;
}

/** What a gesture does at a moment: its roles' rotations and its weight. */
interface Part {
  poses: [number, Quat][];
  weight: number;
}

/** Somebody who follows directions: the living rest, turned to the visitor, with gestures upon it. */
export class Performer {
  private readonly living: Living;
  private readonly clips: ReadonlyMap<string, readonly [Clip, Clip]>; // and mirrored
  private taken: Taken[] = [];

  constructor(living: Living, clips: ReadonlyMap<string, Clip>) {
    this.living = living;
    this.clips = new Map([...clips].map(([name, clip]) => [name, [clip, clip.mirrored()]]));
  }

  /** The clip of a name, made with the right hand where it is one of one hand. */
  clip(name: string): Clip | undefined {
    return this.clips.get(name)?.[0];
  }

  /** Takes on more directions, whose times are those of a clock; gestures that nobody knows are left out. */
  follow(directions: readonly Direction[], clock: Clock): void {
    for (const direction of directions) {
      if (isCue(direction)) {
        const clip = this.clips.get(direction.name)?.[direction.mirror ? 1 : 0];
        if (clip) this.taken.push({ cue: direction, clip, clock, release: null });
      } else {
        const held = this.taken.find((one) => one.clock === clock && one.cue.number === direction.number);
        if (held) held.release = direction.time;
      }
    }
  }

  /** An utterance falls silent: what has not begun is dropped, what is held is let go after its stroke. */
  stop(clock: Clock, time: number): void {
    const now = time - clock.offset;
    this.taken = this.taken.filter((one) => one.clock !== clock || one.cue.begin < now);
    for (const one of this.taken) {
      if (one.clock !== clock || one.release !== null) continue;
      one.release = Math.max(now, roundedRelease(one.clip, one.cue, one.cue.stroke));
    }
  }

  /** Forgets gestures that are over at a time. */
  tidy(time: number): void {
    this.taken = this.taken.filter(({ clip, release, clock }) => time - clock.offset <= endOf(clip, release));
  }

  /**
   * The whole body at a time of the page, s.
   *
   * @param turn what chest, neck and head turn to the visitor
   */
  at(time: number, turn?: readonly Quat[]): Moment {
    const { pose, root } = this.living.at(time);
    for (const [i, role] of TURNED.entries()) if (turn) pose[role] = multiply(turn[i]!, pose[role]!);
    const parts = this.taken.flatMap((one) => partOf(one, time));
    const left = ROLES.map(() => 1); // what later gestures leave of earlier ones
    for (const part of parts.toReversed()) {
      for (const [role, quat] of part.poses) {
        if (!ADDED[role]) continue;
        pose[role] = multiply(pose[role]!, power(quat, part.weight * left[role]!));
        left[role]! *= 1 - part.weight;
      }
    }
    for (const part of parts) {
      for (const [role, quat] of part.poses) if (!ADDED[role]) pose[role] = slerp(pose[role]!, quat, part.weight);
    }
    return { pose, root };
  }
}

/** What a gesture does at a time of the page; nothing before it begins and when it is over. */
function partOf({ cue, clip, clock, release }: Taken, time: number): Part[] {
  const now = time - clock.offset;
  if (now < cue.begin || now > endOf(clip, release)) return [];
  return [{ poses: clip.at(clipTime(clip, cue, release, now)), weight: weight(clip, cue, release, now) }];
}
