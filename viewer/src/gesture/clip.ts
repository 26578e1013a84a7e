import type { Quat } from '../rig/quaternions.ts';
import { Curve } from './curves.ts';
import { mirroredRole } from './roles.ts';
import { mirrored } from './turning.ts';

/** The phases of a gesture, s. */
export interface Marks {
  ready: number; // the stroke begins
  stroke: number; // it arrives: this falls on an accent
  hold: number;
  release: number; // the hold is over; from `hold` to here may be gone round again
  end: number;
}

const MOVES = 1e-2; // of a quaternion's coordinate: a hold in which nothing changes as much stays

/** A gesture as rotation curves by role. */
export class Clip {
  readonly name: string;
  readonly marks: Marks;
  readonly curves: ReadonlyMap<number, Curve>; // by the role's number, ascending
  /** Seconds of what is gone round again while it is held; 0 where nothing is. */
  readonly cycle: number;

  constructor(name: string, marks: Marks, curves: ReadonlyMap<number, Curve>) {
    this.name = name;
    this.marks = marks;
    this.curves = curves;
    const length = marks.release - marks.hold;
    const moments = Array.from({ length: 9 }, (_, i) => marks.hold + (i / 8) * length);
    this.cycle = [...curves.values()].some((curve) => curve.range(moments) > MOVES) ? length : 0;
  }

  /** Its roles at a time, by number. */
  at(time: number): [number, Quat][] {
    return [...this.curves].map(([role, curve]) => [role, curve.at(time)]);
  }

  /** The same with the other hand. */
  mirrored(): Clip {
    const swapped = [...this.curves].map(([role, { times, rotations }]): [number, Curve] => {
      return [mirroredRole(role), new Curve(times, rotations.map(mirrored))];
    });
    return new Clip(this.name, this.marks, new Map(swapped.toSorted(([a], [b]) => a - b)));
  }
}
