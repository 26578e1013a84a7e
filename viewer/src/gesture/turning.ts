import { cross, dot, fromRotvec, multiply, normalized, rotate, scaled, subtract, toRotvec, type Quat, type Vector } from '../rig/quaternions.ts';

/** The vector scaled to length 1; zero stays zero. All functions are as in `ico3d/motion/turning.py`. */
export function unit(vector: Vector): Vector {
  return scaled(vector, 1 / Math.max(Math.sqrt(dot(vector, vector)), 1e-12));
}

/** The component of a vector orthogonal to a unit axis, scaled to length 1. */
export function across(vector: Vector, axis: Vector): Vector {
  return unit(subtract(vector, scaled(axis, dot(vector, axis))));
}

/** The rotation about a unit axis by an angle in radians. */
export function about(axis: Vector, angle: number): Quat {
  return fromRotvec(scaled(axis, angle));
}

/** The shortest rotation from a unit vector to another, which must not be opposite. */
export function arc(start: Vector, end: Vector): Quat {
  return normalized([1 + dot(start, end), ...cross(start, end)]);
}

/** The rotation that takes a pair of orthogonal unit vectors to another pair. */
export function aligned(start: readonly [Vector, Vector], end: readonly [Vector, Vector]): Quat {
  const swing = arc(start[0], end[0]);
  const moved = rotate(swing, start[1]);
  const angle = Math.atan2(dot(cross(moved, end[1]), end[0]), dot(moved, end[1]));
  return multiply(about(end[0], angle), swing);
}

/** Twist of a rotation about a unit axis, -π to π radians; the rotation is this twist, then a swing of the axis. */
export function twistAngle(quat: Quat, axis: Vector): number {
  const angle = 2 * Math.atan2(dot([quat[1], quat[2], quat[3]], axis), quat[0]);
  return angle - 2 * Math.PI * Math.round(angle / (2 * Math.PI));
}

/** The rotation about the same axis by a share of the angle. */
export function power(quat: Quat, part: number): Quat {
  return fromRotvec(scaled(toRotvec(quat), part));
}

/** The rotation mirrored in the plane x = 0, which exchanges left and right. */
export function mirrored([w, x, y, z]: Quat): Quat {
  return [w, x, -y, -z];
}
