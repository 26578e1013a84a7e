/** Numbers of which four in a row are a quaternion wxyz. */
export type Numbers = Float64Array | Float32Array | Int16Array;

/** Writes the quaternion at `from`, made 1 long, to `to`; with `sign`, so that w ≥ 0. */
export function normalize(q: Numbers, from: number, out: Float64Array, to: number, sign = false): void {
  const length = Math.hypot(q[from]!, q[from + 1]!, q[from + 2]!, q[from + 3]!);
  const factor = (sign && q[from]! < 0 ? -1 : 1) / (length || 1);
  for (let i = 0; i < 4; i++) out[to + i] = q[from + i]! * factor;
}

/** Writes the Hamilton product of the quaternions at `a` and `b` to `to`. */
export function multiply(p: Numbers, a: number, q: Numbers, b: number, out: Float64Array, to: number): void {
  const [aw, ax, ay, az] = [p[a]!, p[a + 1]!, p[a + 2]!, p[a + 3]!];
  const [bw, bx, by, bz] = [q[b]!, q[b + 1]!, q[b + 2]!, q[b + 3]!];
  out[to] = aw * bw - ax * bx - ay * by - az * bz;
  out[to + 1] = aw * bx + ax * bw + ay * bz - az * by;
  out[to + 2] = aw * by - ax * bz + ay * bw + az * bx;
  out[to + 3] = aw * bz + ax * by - ay * bx + az * bw;
}

/** Writes to `to` what is a part `s` of the shorter way from the quaternion at `a` to that at `b`, both 1 long. */
export function slerp(q: Float64Array, a: number, b: number, s: number, out: Float64Array, to: number): void {
  let cosine = 0;
  for (let i = 0; i < 4; i++) cosine += q[a + i]! * q[b + i]!;
  const sign = cosine < 0 ? -1 : 1;
  const angle = Math.acos(Math.min(Math.abs(cosine), 1));
  const sine = Math.sin(angle);
  const [begin, end] = sine > 1e-6 ? [Math.sin((1 - s) * angle) / sine, Math.sin(s * angle) / sine] : [1 - s, s];
  for (let i = 0; i < 4; i++) out[to + i] = begin * q[a + i]! + sign * end * q[b + i]!;
  normalize(out, to, out, to);
}

/** Writes the rotation matrix of the quaternion at `from`, 1 long, as nine numbers row by row. */
export function toMatrix(q: Float64Array, from: number, out: Float64Array): void {
  const [w, x, y, z] = [q[from]!, q[from + 1]!, q[from + 2]!, q[from + 3]!];
  out[0] = 1 - 2 * (y * y + z * z);
  out[1] = 2 * (x * y - w * z);
  out[2] = 2 * (x * z + w * y);
  out[3] = 2 * (x * y + w * z);
  out[4] = 1 - 2 * (x * x + z * z);
  out[5] = 2 * (y * z - w * x);
  out[6] = 2 * (x * z - w * y);
  out[7] = 2 * (y * z + w * x);
  out[8] = 1 - 2 * (x * x + y * y);
}
