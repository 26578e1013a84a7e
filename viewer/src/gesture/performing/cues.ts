import type { Cue, Release } from '../../protocol.ts';
import type { Clip } from '../clip.ts';

const BLEND_IN = 0.3; // s in which a gesture takes over
const BLEND_OUT = 0.4; // s before its end in which it gives way
const SETTLE = 0.15; // s that the end of a stroke stays at least: no stroke is cut off

/** A gesture to make, or one that is let go; seconds of the utterance that it belongs to. */
export type Direction = Cue | Release;

export function isCue(direction: Direction): direction is Cue {
  return 'name' in direction;
}

/** When the hold begins: the earliest release. */
function holdEnd({ marks }: Clip, cue: Cue): number {
  return cue.stroke + (marks.hold - marks.stroke);
}

/** When, not before `wanted`, a cue may be released: repetition ends where it began. */
export function roundedRelease(clip: Clip, cue: Cue, wanted: number): number {
  const first = holdEnd(clip, cue);
  const stays = clip.marks.release > clip.marks.hold ? SETTLE : 0; // a nod has no hold
  const from = Math.max(wanted, cue.stroke + stays, first);
  return clip.cycle > 0 ? first + clip.cycle * Math.ceil((from - first) / clip.cycle - 1e-9) : from;
}

/** Which second of the clip belongs to a time; `release` is null while the gesture is held. */
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

/** When a cue is over; infinite while it is held. */
export function endOf({ marks }: Clip, release: number | null): number {
  return release === null ? Infinity : release + marks.end - marks.release;
}

/** How far a gesture prevails over what is beneath, 0 to 1. */
export function weight(clip: Clip, cue: Cue, release: number | null, time: number): number {
  const rising = smooth((time - cue.begin) / Math.min(BLEND_IN, cue.stroke - cue.begin));
  return release === null ? rising : rising * smooth((endOf(clip, release) - time) / BLEND_OUT);
}

/** 0 … 1 with zero slope at both ends. */
function smooth(x: number): number {
  const part = Math.min(Math.max(x, 0), 1);
  return part * part * (3 - 2 * part);
}
