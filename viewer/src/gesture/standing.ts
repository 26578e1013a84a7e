import { add, conjugate, cross, dot, multiply, rotate, scaled, subtract, type Quat, type Vector } from '../rig/quaternions.ts';
import type { Figure, Leg } from './figure.ts';
import { indexOf, SIDES } from './roles.ts';
import { across, aligned, unit } from './turning.ts';

const REACH = 0.998; // largest distance of a limb's ends, relative to its length
const LEAST = 0.2; // least distance of a limb's ends, relative to its length
const DOWNWARDS: Vector = [0, -1, 0];

/** Unit directions of the two bones of a limb, and the axis of its hinge, about which `upper` turns to `lower`. */
export interface Bend {
  upper: Vector;
  lower: Vector;
  hinge: Vector;
}

/**
 * Directions of two bones that reach from `start` to `end`, or point there if it is out of reach (law of cosines).
 *
 * @param lengths lengths of upper and lower bone, m
 * @param pole direction in which elbow or knee points
 */
export function reach(start: Vector, end: Vector, lengths: readonly [number, number], pole: Vector): Bend {
  const [first, second] = lengths;
  const whole = first + second;
  const between = subtract(end, start);
  const along = unit(between);
  const distance = Math.min(Math.max(Math.sqrt(dot(between, between)), LEAST * whole), REACH * whole);
  const sideways = across(pole, along);
  const cosine = (first ** 2 + distance ** 2 - second ** 2) / (2 * first * distance);
  const sine = Math.sqrt(Math.max(1 - cosine ** 2, 0));
  const joint = scaled(add(scaled(along, cosine), scaled(sideways, sine)), first);
  return { upper: unit(joint), lower: unit(subtract(scaled(along, distance), joint)), hinge: cross(sideways, along) };
}

/**
 * Poses the legs so that ankles are in their places and feet are flat on the ground.
 *
 * @param root translation of the root from rest, m
 * @param pose pose by role with the rotation of the hips; the roles of the legs are set
 */
export function stand(figure: Figure, root: Vector, pose: Quat[]): void {
  const hips = pose[indexOf('hips')]!;
  for (const side of SIDES) {
    const leg = figure.legs[side];
    const start = add(add(figure.hips, root), rotate(hips, subtract(leg.hip, figure.hips)));
    const [upper, lower] = bones(leg, start);
    pose[indexOf(`${side}_hip`)] = multiply(conjugate(hips), upper);
    pose[indexOf(`${side}_knee`)] = multiply(conjugate(upper), lower);
    pose[indexOf(`${side}_ankle`)] = conjugate(lower);
  }
}

/** Rotations in the world, from rest, of the two bones of a leg whose hip is at `start`. */
function bones(leg: Leg, start: Vector): [Quat, Quat] {
  const pole = scaled(cross(leg.hinge, DOWNWARDS), -1);
  const bend = reach(start, leg.ankle, leg.lengths, pole);
  return [
    aligned([leg.upper, leg.hinge], [bend.upper, bend.hinge]),
    aligned([leg.lower, leg.hinge], [bend.lower, bend.hinge]),
  ];
}
