import { add, conjugate, multiply, rotate, scaled, subtract, type Quat, type Vector } from '../rig/quaternions.ts';
import type { Rig } from '../rig/rig.ts';
import type { Figure } from './figure.ts';
import { SIDES } from './roles.ts';
import { about, twistAngle } from './turning.ts';

const UP: Vector = [0, 1, 0];

/** How a rig is posed: rotations of its joints about themselves, and metres that its root moves. */
export interface RigPose {
  rotations: readonly Quat[]; // (J,4)
  root: Vector;
}

/** Where somebody stands in the world, who in rest space stands at its origin and faces +z. */
export class Placement {
  private readonly origin: Vector; // of rest space, m in the world
  private readonly turn: Quat;
  private readonly pivot: Vector; // joint 0 at rest

  /**
   * Puts the feet where they were in a recorded pose, and turns the person as the hips were about the vertical.
   *
   * @param figure of the rig
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

  /** A pose of rest space, in the world. */
  place({ rotations, root }: RigPose): RigPose {
    const pivot = add(rotate(this.turn, add(this.pivot, root)), this.origin);
    return { rotations: [multiply(this.turn, rotations[0]!), ...rotations.slice(1)], root: subtract(pivot, this.pivot) };
  }

  /** A point of the world, as rest space has it. */
  toRest(point: Vector): Vector {
    return rotate(conjugate(this.turn), subtract(point, this.origin));
  }
}

/** How far a joint has moved rigidly from one pose to another: x goes to q·x + shift. */
export function jointMotion(rig: Rig, joint: number, from: RigPose, to: RigPose): [Quat, Vector] {
  const [before, after] = [from, to].map(({ rotations, root }) => rig.posed(rotations, root));
  const turn = multiply(after!.turned[joint]!, conjugate(before!.turned[joint]!));
  return [turn, subtract(after!.places[joint]!, rotate(turn, before!.places[joint]!))];
}
