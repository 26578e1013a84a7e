import { quatAt, upper } from './quaternions.ts';

const RIDGE = 0.01; // added to the likeness of a known pose and itself, as its values are not exact

/** Values of some known poses. */
export interface KnownPoses {
  count: number;
  rotations: Float64Array; // (P,J,4) local rotation of each joint, wxyz
  values: Float64Array; // (P,K)
  width: number; // of the kernel, in units of a pose's features
}

/**
 * K values as a smooth function of the pose, by kernel ridge regression on a few known poses: at a
 * known pose they are nearly those that are known, far from all they are the mean, and they never
 * leave the range of the known ones.
 */
export class PoseRegression {
  private readonly known: KnownPoses;
  private readonly places: Float64Array; // (P,3·J) features of the known poses
  private readonly mean: Float64Array; // (K,)
  private readonly range: readonly (readonly [number, number])[]; // of each value
  private readonly weights: Float64Array; // (P,K)

  constructor(known: KnownPoses) {
    const { count, rotations, values } = known;
    const size = values.length / count;
    const columns = Array.from({ length: size }, (_, k) => Array.from({ length: count }, (_, p) => values[p * size + k]!));
    this.known = known;
    this.places = features(rotations);
    this.mean = Float64Array.from(columns, (column) => column.reduce((sum, value) => sum + value, 0) / count);
    this.range = columns.map((column) => [Math.min(...column), Math.max(...column)]);
    const row = rotations.length / count;
    const likeness = new Float64Array(count * count);
    for (let p = 0; p < count; p++) {
      likeness.set(this.likeness(features(rotations.subarray(p * row, (p + 1) * row))), p * count);
      likeness[p * count + p]! += RIDGE;
    }
    const offsets = values.map((value, i) => value - this.mean[i % size]!);
    this.weights = solved(likeness, offsets, count);
  }

  /** Writes the values of a pose with local rotations (J,4), unit quaternions wxyz. */
  at(rotations: Float64Array, out: Float64Array): void {
    out.set(this.mean);
    this.likeness(features(rotations)).forEach((likeness, p) => {
      for (let k = 0; k < out.length; k++) out[k]! += likeness * this.weights[p * out.length + k]!;
    });
    this.range.forEach(([least, most], k) => (out[k] = Math.min(Math.max(out[k]!, least), most)));
  }

  /** Likeness (P,) of a pose with features (3·J,) to the known ones, 1 where they agree. */
  private likeness(place: Float64Array): Float64Array {
    const { count, width } = this.known;
    const size = place.length;
    const found = new Float64Array(count);
    for (let p = 0; p < count; p++) {
      let apart = 0;
      for (let i = 0; i < size; i++) apart += (this.places[p * size + i]! - place[i]!) ** 2;
      found[p] = Math.exp(-apart / (2 * width ** 2));
    }
    return found;
  }
}

/** Features (…,3) of rotations (…,4) by which poses are compared: sin(angle / 2) times the axis. */
function features(rotations: Float64Array): Float64Array {
  const found = new Float64Array((3 * rotations.length) / 4);
  for (let i = 0; i < rotations.length / 4; i++) found.set(upper(quatAt(rotations, i)).slice(1), 3 * i);
  return found;
}

/** X (n,m) with A·X = B for a symmetric positive definite A (n,n), which becomes its Cholesky factor; B becomes X. */
function solved(a: Float64Array, b: Float64Array, n: number): Float64Array {
  const m = b.length / n;
  for (let row = 0; row < n; row++) {
    for (let column = 0; column <= row; column++) {
      let rest = a[row * n + column]!;
      for (let i = 0; i < column; i++) rest -= a[row * n + i]! * a[column * n + i]!;
      a[row * n + column] = row === column ? Math.sqrt(rest) : rest / a[column * n + column]!;
    }
  }
  for (let k = 0; k < m; k++) {
    for (let row = 0; row < n; row++) {
      for (let i = 0; i < row; i++) b[row * m + k]! -= a[row * n + i]! * b[i * m + k]!;
      b[row * m + k]! /= a[row * n + row]!;
    }
    for (let row = n - 1; row >= 0; row--) {
      for (let i = row + 1; i < n; i++) b[row * m + k]! -= a[i * n + row]! * b[i * m + k]!;
      b[row * m + k]! /= a[row * n + row]!;
    }
  }
  return b;
}
