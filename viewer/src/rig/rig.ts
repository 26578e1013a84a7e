import { add, multiply, rotate, subtract, toMatrix, type Quat, type Vector } from './quaternions.ts';

/** The joints of a posed rig in the world. */
export interface Posed {
  turned: Quat[]; // (J,4) rotations from rest space to the world
  places: Vector[]; // (J,3) positions, m
}

/**
 * A skeleton of J joints, as in `ico3d/rig/rig.py`.
 *
 * At rest all rotations are the identity; local rotations are given in the axes of rest space.
 */
export class Rig {
  readonly parents: readonly number[]; // index of each joint's parent, which comes before it; -1 for joint 0, the root
  readonly joints: readonly Vector[]; // positions at rest, m

  constructor(parents: readonly number[], joints: readonly Vector[]) {
    this.parents = parents;
    this.joints = joints;
  }

  /**
   * Rotations and positions of the joints in a pose.
   *
   * @param rotations local rotation of each joint
   * @param root translation of the root from rest, m
   */
  posed(rotations: readonly Quat[], root: Vector): Posed {
    const turned: Quat[] = [rotations[0]!];
    const places: Vector[] = [add(this.joints[0]!, root)];
    for (let joint = 1; joint < this.parents.length; joint++) {
      const parent = this.parents[joint]!;
      const bone = subtract(this.joints[joint]!, this.joints[parent]!);
      turned.push(multiply(turned[parent]!, rotations[joint]!));
      places.push(add(places[parent]!, rotate(turned[parent]!, bone)));
    }
    return { turned, places };
  }

  /**
   * Rigid transforms of points bound to each joint, from rest to the world.
   *
   * @returns (J,3,4) rotation matrix and, in the last column, translation in m
   */
  matrices({ turned, places }: Posed): Float64Array {
    const found = new Float64Array(12 * turned.length);
    for (const [joint, quat] of turned.entries()) {
      const matrix = toMatrix(quat);
      const shift = subtract(places[joint]!, rotate(quat, this.joints[joint]!));
      for (let row = 0; row < 3; row++) {
        found.set(matrix.slice(3 * row, 3 * row + 3), 12 * joint + 4 * row);
        found[12 * joint + 4 * row + 3] = shift[row]!;
      }
    }
    return found;
  }
}
