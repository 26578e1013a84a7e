import { add, conjugate, fromRotvec, multiply, scaled, subtract, toRotvec, type Quat, type Vector } from '../rig/quaternions.ts';

/** A rotation over time, interpolated cubically between keys; `docs/motion.md` defines it. */
export class Curve {
  readonly times: readonly number[]; // s, ascending from 0
  readonly rotations: readonly Quat[];
  private readonly steps: Vector[]; // rotation vectors from key to key
  private readonly slopes: Vector[]; // angular velocities at the keys, radians per second

  constructor(times: readonly number[], rotations: readonly Quat[]) {
    this.times = times;
    this.rotations = rotations;
    const spans = times.slice(1).map((time, i) => time - times[i]!);
    this.steps = spans.map((_, i) => toRotvec(multiply(conjugate(rotations[i]!), rotations[i + 1]!)));
    const speeds = this.steps.map((step, i) => scaled(step, 1 / spans[i]!));
    this.slopes = times.map((_, i) => {
      if (i === 0 || i === times.length - 1) return [0, 0, 0];
      const [before, after] = [spans[i - 1]!, spans[i]!];
      return scaled(add(scaled(speeds[i - 1]!, after), scaled(speeds[i]!, before)), 1 / (before + after));
    });
  }

  /** The rotation at a time, s; constant before the first key and after the last one. */
  at(time: number): Quat {
    const index = this.keyBefore(time);
    const first = this.rotations[index]!;
    if (index === this.times.length - 1) return first;
    const span = this.times[index + 1]! - this.times[index]!;
    const s = Math.min(Math.max((time - this.times[index]!) / span, 0), 1);
    const bend = subtract(scaled(this.slopes[index]!, 1 - s), scaled(this.slopes[index + 1]!, s));
    return multiply(first, fromRotvec(add(scaled(this.steps[index]!, s * s * (3 - 2 * s)), scaled(bend, span * s * (1 - s)))));
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
