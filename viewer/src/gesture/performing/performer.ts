import { multiply, slerp, type Quat } from '../../rig/quaternions.ts';
import type { Cue } from '../../protocol.ts';
import { ROLES } from '../../shared.ts';
import type { Clip } from '../clip.ts';
import type { Living, Moment } from '../living.ts';
import { indexOf } from '../roles.ts';
import { power } from '../turning.ts';
import { clipTime, endOf, isCue, roundedRelease, weight, type Direction } from './cues.ts';

/** For each role, whether its rotations in gestures are added to the rest; for others they replace the rest. */
const ADDED = ROLES.map((role) => /^(hips|spine|chest|neck|head|.*_clavicle)$/.test(role));
const TURNED = (['chest', 'neck', 'head'] as const).map(indexOf);

/** The clock of an utterance. */
export interface Clock {
  offset: number; // time of the page at which the utterance began, s; infinite until it begins
}

/** A cue that is followed. */
interface Taken {
  cue: Cue;
  clip: Clip;
  clock: Clock;
  release: number | null;
}

/** A gesture at a moment. */
interface Part {
  poses: [number, Quat][]; // roles that it moves, with their rotations
  weight: number; // over the pose beneath it, 0 to 1
}

/** Gestures that are kept in mind: each is worked out in every picture, and an hour of speech has fewer. */
const MOST_TAKEN = 1000;

/** A person who follows directions: the living rest, turned to the visitor, with gestures blended in. */
export class Performer {
  private readonly living: Living;
  private readonly clips: ReadonlyMap<string, readonly [Clip, Clip]>; // each clip with its mirror image
  private taken: Taken[] = [];

  constructor(living: Living, clips: ReadonlyMap<string, Clip>) {
    this.living = living;
    this.clips = new Map([...clips].map(([name, clip]) => [name, [clip, clip.mirrored()]]));
  }

  /** The clip of a name, not mirrored. */
  clip(name: string): Clip | undefined {
    return this.clips.get(name)?.[0];
  }

  /** Adds directions, whose times are those of a clock; gestures that are not known are left out. */
  follow(directions: readonly Direction[], clock: Clock): void {
    for (const direction of directions) {
      if (isCue(direction)) {
        const clip = this.clips.get(direction.name)?.[direction.mirror ? 1 : 0];
        if (clip && this.taken.length < MOST_TAKEN) this.taken.push({ cue: direction, clip, clock, release: null });
      } else {
        const held = this.taken.find((one) => one.clock === clock && one.cue.number === direction.number);
        if (held) held.release = direction.time;
      }
    }
  }

  /** Ends an utterance at a time of the page: gestures to come are dropped, held ones released after their strokes. */
  stop(clock: Clock, time: number): void {
    const now = time - clock.offset;
    this.taken = this.taken.filter((one) => one.clock !== clock || one.cue.begin < now);
    for (const one of this.taken) {
      if (one.clock !== clock || one.release !== null) continue;
      one.release = Math.max(now, roundedRelease(one.clip, one.cue, one.cue.stroke));
    }
  }

  /** Removes gestures that are over at a time of the page, s. */
  tidy(time: number): void {
    this.taken = this.taken.filter(({ clip, release, clock }) => time - clock.offset <= endOf(clip, release));
  }

  /**
   * Pose of the whole body at a time of the page, s.
   *
   * @param turn rotations of chest, neck and head to the visitor, as by `Gaze.at`
   */
  at(time: number, turn?: readonly Quat[]): Moment {
    const { pose, root } = this.living.at(time);
    for (const [i, role] of TURNED.entries()) if (turn) pose[role] = multiply(turn[i]!, pose[role]!);
    const parts = this.taken.flatMap((one) => partOf(one, time));
    const left = ROLES.map(() => 1); // share that later gestures leave to earlier ones
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

/** The gesture of a cue at a time of the page, s; none before it begins and after it is over. */
function partOf({ cue, clip, clock, release }: Taken, time: number): Part[] {
  const now = time - clock.offset;
  if (now < cue.begin || now > endOf(clip, release)) return [];
  return [{ poses: clip.at(clipTime(clip, cue, release, now)), weight: weight(clip, cue, release, now) }];
}
