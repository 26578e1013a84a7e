import { cross, dot, fromRotvec, multiply, normalized, rotate, scaled, subtract, toRotvec, type Quat, type Vector } from '../rig/quaternions.ts';

/** Of length 1; zeros stay zeros. Functions as in `ico3d/motion/turning.py`. */
export function unit(vector: Vector): Vector {
  return scaled(vector, 1 / Math.max(Math.sqrt(dot(vector, vector)), 1e-12));
}

/** The unit vector of what stands at right angles to a unit axis. */
export function across(vector: Vector, axis: Vector): Vector {
  return unit(subtract(vector, scaled(axis, dot(vector, axis))));
}

/** About a unit axis by radians. */
export function about(axis: Vector, angle: number): Quat {
  return fromRotvec(scaled(axis, angle));
}

/** The shortest rotation between unit vectors that are not opposite. */
export function arc(start: Vector, end: Vector): Quat {
  return normalized([1 + dot(start, end), ...cross(start, end)]);
}

/** Takes a direction to another, and what stands at right angles to it as well; all of length 1. */
export function aligned(start: readonly [Vector, Vector], end: readonly [Vector, Vector]): Quat {
  const swing = arc(start[0], end[0]);
  const moved = rotate(swing, start[1]);
  const angle = Math.atan2(dot(cross(moved, end[1]), end[0]), dot(moved, end[1]));
  return multiply(about(end[0], angle), swing);
}

/** Radians, -π to π, that a rotation turns about a unit axis before it swings it. */
export function twistAngle(quat: Quat, axis: Vector): number {
  const angle = 2 * Math.atan2(dot([quat[1], quat[2], quat[3]], axis), quat[0]);
  return angle - 2 * Math.PI * Math.round(angle / (2 * Math.PI));
}

/** A part of a rotation, on the shorter way. */
export function power(quat: Quat, part: number): Quat {
  return fromRotvec(scaled(toRotvec(quat), part));
}

/** Seen in the mirror that swaps left and right. */
export function mirrored([w, x, y, z]: Quat): Quat {
  return [w, x, -y, -z];
}
