import { add, conjugate, multiply, rotate, scaled, subtract, type Quat, type Vector } from '../rig/quaternions.ts';
import type { Rig } from '../rig/rig.ts';
import type { Figure } from './figure.ts';
import { SIDES } from './roles.ts';
import { about, twistAngle } from './turning.ts';

const UP: Vector = [0, 1, 0];

/** A pose of a rig. */
export interface RigPose {
  rotations: readonly Quat[]; // (J,4) local rotation of each joint
  root: Vector; // translation of the root from rest, m
}

/** The rigid motion from rest space, where a person faces +z, to where the person was recorded. */
export class Placement {
  private readonly origin: Vector; // position of rest space's origin in the world, m
  private readonly turn: Quat; // about the vertical
  private readonly pivot: Vector; // joint 0 at rest, m

  /**
   * Keeps the position of the feet, and the direction of the hips, of a recorded pose.
   *
   * @param figure figure of the person with this rig
   */
  constructor(rig: Rig, figure: Figure, recorded: RigPose) {
    const { turned, places } = rig.posed(recorded.rotations, recorded.root);
    const last = (role: string) => figure.parts.find((part) => part.role === role)!.joints.at(-1)!;
    const middle = (points: Vector[]) => scaled(points.reduce(add), 1 / points.length);
    const stood = middle(SIDES.map((side) => places[last(`${side}_ankle`)]!));
    const stands = middle(SIDES.map((side) => figure.legs[side].ankle));
    this.turn = about(UP, twistAngle(turned[last('hips')]!, UP));
    this.origin = subtract(stood, rotate(this.turn, stands));
    this.pivot = rig.joints[0]!;
  }

  /** Moves a pose from rest space to the world. */
  place({ rotations, root }: RigPose): RigPose {
    const pivot = add(rotate(this.turn, add(this.pivot, root)), this.origin);
    return { rotations: [multiply(this.turn, rotations[0]!), ...rotations.slice(1)], root: subtract(pivot, this.pivot) };
  }

  /** Moves a point from the world to rest space, m. */
  toRest(point: Vector): Vector {
    return rotate(conjugate(this.turn), subtract(point, this.origin));
  }
}

/** Rigid motion of a joint from one pose to another: a point x that it carries moves to q·x + shift, m. */
export function jointMotion(rig: Rig, joint: number, from: RigPose, to: RigPose): [Quat, Vector] {
  const [before, after] = [from, to].map(({ rotations, root }) => rig.posed(rotations, root));
  const turn = multiply(after!.turned[joint]!, conjugate(before!.turned[joint]!));
  return [turn, subtract(after!.places[joint]!, rotate(turn, before!.places[joint]!))];
}
