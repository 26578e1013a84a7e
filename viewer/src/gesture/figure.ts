import { PageError } from '../errors.ts';
import type { Quat, Vector } from '../rig/quaternions.ts';
import { ROLES } from '../shared.ts';
import { findRole, SIDES, type Side } from './roles.ts';

/** The joints of a rig that play a role together. */
export interface Part {
  role: string;
  joints: number[]; // indices, from the root outwards
  standard: Quat; // rotation of the role's joint from the rig's rest to the standard pose
  turn: number; // twist that is added to that of the pose, radians
  shares: number[] | null; // share of the twist of each joint; null where joints share the whole rotation evenly
  axes: Vector[]; // unit axes about which the joints after the first one twist
}

/** Measures of a leg; positions and lengths in m. */
export interface Leg {
  hip: Vector; // position at rest
  ankle: Vector; // position where the person stands
  lengths: [number, number]; // of upper and lower bone
  upper: Vector; // unit direction of the upper bone at rest
  lower: Vector; // unit direction of the lower bone at rest
  hinge: Vector; // unit axis of the knee at rest
}

/** Measures of a person, made when the avatar was baked (`ico3d/motion/figure.py`). */
export interface Figure {
  height: number; // height of the head's joint above the ankles, m
  eyes: Vector; // point between the eyes at rest, m
  hung: Quat[]; // (R,4) pose by role with hanging arms
  sink: number; // how far the hips are lowered from rest, m
  parts: Part[]; // one for each role that the rig has
  hips: Vector; // joint of the hips at rest, m
  legs: Record<Side, Leg>;
}

/**
 * Checks a figure that was read from JSON.
 *
 * @param joints number of the rig's joints
 * @throws PageError which names the field that is wrong
 */
export function checkFigure(value: unknown, joints: number): Figure {
  const figure = value as Figure;
  for (const key of ['height', 'sink'] as const) if (!isNumbers([figure?.[key]], 1)) bad(key);
  for (const key of ['eyes', 'hips'] as const) if (!isNumbers(figure[key], 3)) bad(key);
  if (figure.hung?.length !== ROLES.length || !figure.hung.every(isRotation)) bad('hung');
  if (!Array.isArray(figure.parts) || figure.parts.length === 0) bad('parts');
  for (const part of figure.parts) if (!isPart(part, joints)) bad(`parts of ${part?.role}`);
  for (const side of SIDES) if (!isLeg(figure.legs?.[side])) bad(`legs.${side}`);
  return figure;
}

function isPart(part: Part, joints: number): boolean {
  const known = part && findRole(part.role) !== undefined && Array.isArray(part.joints) && part.joints.length > 0;
  if (!known || !part.joints.every((joint) => Number.isInteger(joint) && joint >= 0 && joint < joints)) return false;
  if (!isRotation(part.standard) || !Number.isFinite(part.turn)) return false;
  if (part.shares === null) return true;
  return isNumbers(part.shares, part.joints.length) && part.axes?.length === part.joints.length - 1 && part.axes.every(isDirection);
}

function isLeg(leg: Leg): boolean {
  const vectors = leg && [leg.hip, leg.ankle].every((place) => isNumbers(place, 3)) && isNumbers(leg.lengths, 2);
  return vectors && leg.lengths.every((length) => length > 0) && [leg.upper, leg.lower, leg.hinge].every(isDirection);
}

function isRotation(value: unknown): boolean {
  return isNumbers(value, 4) && isUnit(value);
}

function isDirection(value: unknown): boolean {
  return isNumbers(value, 3) && isUnit(value);
}

function isUnit(values: readonly number[]): boolean {
  return Math.abs(Math.hypot(...values) - 1) < 1e-6;
}

function isNumbers(value: unknown, count: number): value is number[] {
  return Array.isArray(value) && value.length === count && value.every(Number.isFinite);
}

function bad(field: string): never {
  throw new PageError(`The gestures of this avatar are damaged: ${field} of the figure is wrong.`);
}
