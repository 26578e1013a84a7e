import { add, conjugate, fromRotvec, multiply, scaled, subtract, toRotvec, type Quat, type Vector } from '../rig/quaternions.ts';

/** What a curve does between two keys. */
interface Part {
  index: number; // of the first key
  step: Vector; // rotation vector from the one to the other
  slopes: [Vector, Vector]; // angular velocities at both, radians per second
}

/** A rotation over time, interpolated cubically between keys; `docs/motion.md` defines it. */
export class Curve {
  readonly times: readonly number[]; // s, ascending from 0
  readonly rotations: readonly Quat[];
  private part: Part = { index: -1, step: [0, 0, 0], slopes: [[0, 0, 0], [0, 0, 0]] }; // that was asked for last

  constructor(times: readonly number[], rotations: readonly Quat[]) {
    this.times = times;
    this.rotations = rotations;
  }

  /** The rotation at a time, s; constant before the first key and after the last one. */
  at(time: number): Quat {
    const index = this.keyBefore(time);
    const first = this.rotations[index]!;
    if (index === this.times.length - 1) return first;
    // Only the part at hand is worked out: of all keys together it would take ten times their memory.
    if (this.part.index !== index) this.part = { index, step: this.step(index), slopes: [this.slope(index), this.slope(index + 1)] };
    const { step, slopes } = this.part;
    const span = this.span(index);
    const s = Math.min(Math.max((time - this.times[index]!) / span, 0), 1);
    const bend = subtract(scaled(slopes[0], 1 - s), scaled(slopes[1], s));
    return multiply(first, fromRotvec(add(scaled(step, s * s * (3 - 2 * s)), scaled(bend, span * s * (1 - s)))));
  }

  /** Seconds from a key to the next. */
  private span(index: number): number {
    return this.times[index + 1]! - this.times[index]!;
  }

  /** Rotation vector from a key to the next. */
  private step(index: number): Vector {
    return toRotvec(multiply(conjugate(this.rotations[index]!), this.rotations[index + 1]!));
  }

  /** Angular velocity at a key, radians per second. */
  private slope(index: number): Vector {
    if (index === 0 || index === this.times.length - 1) return [0, 0, 0];
    const [before, after] = [this.span(index - 1), this.span(index)];
    const [from, to] = [scaled(this.step(index - 1), 1 / before), scaled(this.step(index), 1 / after)];
    return scaled(add(scaled(from, after), scaled(to, before)), 1 / (before + after));
  }

  /** Largest range of a coordinate of the quaternion over some times, s. */
  range(times: readonly number[]): number {
    const values = times.map((time) => this.at(time));
    return Math.max(...[0, 1, 2, 3].map((i) => Math.max(...values.map((q) => q[i]!)) - Math.min(...values.map((q) => q[i]!))));
  }

  /** Index of the last key that is not after a time, limited to the last key but one if there are several. */
  private keyBefore(time: number): number {
    let [low, high] = [0, Math.max(this.times.length - 2, 0)];
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (this.times[middle]! <= time) low = middle;
      else high = middle - 1;
    }
    return low;
  }
}
