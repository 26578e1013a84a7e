import type { Quat } from '../rig/quaternions.ts';
import { Curve } from './curves.ts';
import { mirroredRole } from './roles.ts';
import { mirrored } from './turning.ts';

/** Times of the phases of a gesture, s from its beginning. */
export interface Marks {
  ready: number; // the preparation ends and the stroke begins
  stroke: number; // the stroke arrives, which is to fall on an accent of speech
  hold: number; // the hold begins
  release: number; // the hold ends; motion between `hold` and `release` may be repeated
  end: number; // the gesture is over
}

const MOVES = 1e-2; // a hold in which no coordinate of a quaternion changes by more is still

/** A gesture as rotation curves by role. */
export class Clip {
  readonly name: string;
  readonly marks: Marks;
  readonly curves: ReadonlyMap<number, Curve>; // by index of the role, ascending
  /** Duration of the motion that is repeated in the hold, s; 0 if the hold is still. */
  readonly cycle: number;

  constructor(name: string, marks: Marks, curves: ReadonlyMap<number, Curve>) {
    this.name = name;
    this.marks = marks;
    this.curves = curves;
    const length = marks.release - marks.hold;
    const moments = Array.from({ length: 9 }, (_, i) => marks.hold + (i / 8) * length);
    this.cycle = [...curves.values()].some((curve) => curve.range(moments) > MOVES) ? length : 0;
  }

  /** Indices of the moved roles with their rotations at a time, s. */
  at(time: number): [number, Quat][] {
    return [...this.curves].map(([role, curve]) => [role, curve.at(time)]);
  }

  /** The mirror image of the gesture: left and right are exchanged. */
  mirrored(): Clip {
    const swapped = [...this.curves].map(([role, { times, rotations }]): [number, Curve] => {
      return [mirroredRole(role), new Curve(times, rotations.map(mirrored))];
    });
    return new Clip(this.name, this.marks, new Map(swapped.toSorted(([a], [b]) => a - b)));
  }
}
