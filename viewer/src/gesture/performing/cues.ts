import { smooth } from '../../face/idle.ts';
import type { Cue, Release } from '../../protocol.ts';
import type { Clip } from '../clip.ts';

const BLEND_IN = 0.3; // s in which a gesture blends in at its beginning
const BLEND_OUT = 0.4; // s in which a gesture blends out before its end
const SETTLE = 0.15; // least time for which the end of a stroke is held, so that no stroke is cut off, s

/** A gesture to make, or the release of a held one; times are seconds of the utterance that it belongs to. */
export type Direction = Cue | Release;

export function isCue(direction: Direction): direction is Cue {
  return 'name' in direction;
}

/** Time at which the hold of a cue begins, which is the earliest release, s. */
function holdEnd({ marks }: Clip, cue: Cue): number {
  return cue.stroke + (marks.hold - marks.stroke);
}

/** Earliest time, not before `wanted`, at which a cue may be released, s; a repeated motion is completed first. */
export function roundedRelease(clip: Clip, cue: Cue, wanted: number): number {
  const first = holdEnd(clip, cue);
  const stays = clip.marks.release > clip.marks.hold ? SETTLE : 0; // a nod has no hold
  const from = Math.max(wanted, cue.stroke + stays, first);
  return clip.cycle > 0 ? first + clip.cycle * Math.ceil((from - first) / clip.cycle - 1e-9) : from;
}

/** Time of the clip that is shown at a time of the speech, s; `release` is null while the gesture is held. */
export function clipTime(clip: Clip, cue: Cue, release: number | null, time: number): number {
  const { marks } = clip;
  const clamped = (seconds: number) => Math.min(Math.max(seconds, 0), marks.end);
  if (release !== null && time >= release) return clamped(marks.release + (time - release));
  if (time < cue.stroke) {
    const rate = (marks.stroke - cue.skip) / (cue.stroke - cue.begin);
    return clamped(cue.skip + (time - cue.begin) * rate);
  }
  const since = time - holdEnd(clip, cue);
  if (clip.cycle > 0 && since > 0) return clamped(marks.hold + since - clip.cycle * Math.floor(since / clip.cycle));
  return clamped(Math.min(marks.stroke + (time - cue.stroke), marks.hold));
}

/** Time at which a cue is over, s; infinite while it is held. */
export function endOf({ marks }: Clip, release: number | null): number {
  return release === null ? Infinity : release + marks.end - marks.release;
}

/** Weight of a gesture over the pose beneath it, 0 to 1. */
export function weight(clip: Clip, cue: Cue, release: number | null, time: number): number {
  const rising = smooth((time - cue.begin) / Math.min(BLEND_IN, cue.stroke - cue.begin));
  return release === null ? rising : rising * smooth((endOf(clip, release) - time) / BLEND_OUT);
}
