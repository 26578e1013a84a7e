/** A quaternion wxyz, of length 1 unless stated otherwise; functions are as in `ico3d/rig/quaternions.py`. */
export type Quat = readonly [number, number, number, number];
export type Vector = readonly [number, number, number];

export const IDENTITY: Quat = [1, 0, 0, 0];

export function add(a: Vector, b: Vector): Vector {
  return [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
}

export function subtract(a: Vector, b: Vector): Vector {
  return [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
}

export function scaled(a: Vector, factor: number): Vector {
  return [a[0] * factor, a[1] * factor, a[2] * factor];
}

export function dot(a: Vector, b: Vector): number {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

export function cross(a: Vector, b: Vector): Vector {
  return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}

export function dotQuat(a: Quat, b: Quat): number {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
}

/** The quaternion scaled to length 1; zero becomes the identity. */
export function normalized([w, x, y, z]: Quat): Quat {
  const length = Math.sqrt(w * w + x * x + y * y + z * z);
  return length > 1e-12 ? [w / length, x / length, y / length, z / length] : IDENTITY;
}

/** Quaternion number `index` of a flat array (…,4), scaled to length 1. */
export function quatAt(values: ArrayLike<number>, index: number): Quat {
  const at = 4 * index;
  return normalized([values[at]!, values[at + 1]!, values[at + 2]!, values[at + 3]!]);
}

/** The same rotation with w ≥ 0. */
export function upper(quat: Quat): Quat {
  const [w, x, y, z] = quat;
  return w < 0 ? [-w, -x, -y, -z] : quat;
}

/** Hamilton product a·b: first rotates by b, then by a. */
export function multiply([aw, ax, ay, az]: Quat, [bw, bx, by, bz]: Quat): Quat {
  return [
    aw * bw - ax * bx - ay * by - az * bz,
    aw * bx + ax * bw + ay * bz - az * by,
    aw * by - ax * bz + ay * bw + az * bx,
    aw * bz + ax * by - ay * bx + az * bw,
  ];
}

/** The inverse rotation. */
export function conjugate([w, x, y, z]: Quat): Quat {
  return [w, -x, -y, -z];
}

/** The vector rotated by the quaternion. */
export function rotate([w, x, y, z]: Quat, vector: Vector): Vector {
  const axis: Vector = [x, y, z];
  const twice = scaled(cross(axis, vector), 2);
  return add(add(vector, scaled(twice, w)), cross(axis, twice));
}

/** The nine numbers of the rotation matrix, row by row. */
export function toMatrix([w, x, y, z]: Quat): number[] {
  return [
    ...[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
    ...[2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
    ...[2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
  ];
}

/** The quaternion of a rotation vector: axis times angle in radians. */
export function fromRotvec(vector: Vector): Quat {
  const angle = Math.sqrt(dot(vector, vector));
  const factor = angle > 0 ? Math.sin(angle / 2) / angle : 0.5;
  return [Math.cos(angle / 2), factor * vector[0], factor * vector[1], factor * vector[2]];
}

/** The rotation vector of a quaternion: axis times angle, at most π radians. */
export function toRotvec(quat: Quat): Vector {
  const sign = quat[0] < 0 ? -1 : 1;
  const axis: Vector = [sign * quat[1], sign * quat[2], sign * quat[3]];
  const sine = Math.sqrt(dot(axis, axis));
  const angle = 2 * Math.atan2(sine, sign * quat[0]);
  return scaled(axis, sine > 1e-9 ? angle / sine : 2);
}

/** Interpolation on the shorter arc from a (part 0) to b (part 1). */
export function slerp(a: Quat, b: Quat, part: number): Quat {
  return multiply(a, fromRotvec(scaled(toRotvec(multiply(conjugate(a), b)), part)));
}
