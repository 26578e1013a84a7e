import { conjugate, IDENTITY, multiply, type Quat } from '../rig/quaternions.ts';
import type { Rig } from '../rig/rig.ts';
import { ROLE_PARENTS } from '../shared.ts';
import type { Figure, Part } from './figure.ts';
import { findRole } from './roles.ts';
import { about, power, twistAngle } from './turning.ts';

const DOWN = [0, -1, 0] as const;

/** Converts poses by role to rotations of a rig's joints; `docs/motion.md` defines it. */
export class Retarget {
  private readonly rig: Rig;
  private readonly plan: Map<number, Part>; // each role's part, by the index of its first joint

  constructor(rig: Rig, figure: Figure) {
    this.rig = rig;
    this.plan = new Map(figure.parts.map((part) => [part.joints[0]!, part]));
  }

  /**
   * Local rotations of all joints for a pose by role.
   *
   * @param byRole local rotations from the standard pose; that of a role that the rig lacks is added to the roles
   *   below it
   */
  pose(byRole: readonly Quat[]): Quat[] {
    const wanted = inWorld(byRole);
    const local: Quat[] = this.rig.parents.map(() => IDENTITY);
    const turned: Quat[] = [];
    for (const [joint, parent] of this.rig.parents.entries()) {
      const before = turned[parent] ?? IDENTITY;
      const part = this.plan.get(joint);
      if (part) turnPart(part, byRole, wanted, before, local);
      turned.push(multiply(before, local[joint]!));
    }
    return local;
  }
}

/** Rotation of each role in the world, from the standard pose. */
function inWorld(byRole: readonly Quat[]): Quat[] {
  const found: Quat[] = [];
  for (const [number, parent] of ROLE_PARENTS.entries()) {
    found.push(parent < 0 ? byRole[number]! : multiply(found[parent]!, byRole[number]!));
  }
  return found;
}

/**
 * Sets the local rotations of a role's joints.
 *
 * @param wanted rotation of each role in the world
 * @param before rotation in the world of the parent of the role's first joint
 * @param local is changed
 */
function turnPart(part: Part, byRole: readonly Quat[], wanted: Quat[], before: Quat, local: Quat[]): void {
  const { joints, shares, standard, axes } = part;
  const number = findRole(part.role)!;
  if (!shares) {
    const whole = multiply(wanted[number]!, standard);
    const each = power(multiply(conjugate(before), whole), 1 / joints.length);
    for (const joint of joints) local[joint] = each;
    return;
  }
  const twist = twistAngle(byRole[number]!, DOWN);
  const swing = multiply(wanted[number]!, about(DOWN, -twist));
  const angle = twist + part.turn;
  const first = multiply(swing, about(DOWN, shares[0]! * angle));
  local[joints[0]!] = multiply(conjugate(before), multiply(first, standard));
  for (const [i, axis] of axes.entries()) local[joints[i + 1]!] = about(axis, shares[i + 1]! * angle);
}
