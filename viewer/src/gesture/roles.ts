import { ROLES } from '../shared.ts';

/** Name of a joint for gestures that is the same in all rigs, such as `hips` or `left_elbow`. */
export type Role = (typeof ROLES)[number];
export type Side = 'left' | 'right';

export const SIDES = ['left', 'right'] as const;

const NUMBERS = new Map<string, number>(ROLES.map((role, number) => [role, number]));

/** Index of a role in a pose; undefined if there is no role of this name. */
export function findRole(name: string): number | undefined {
  return NUMBERS.get(name);
}

/** Index of a role in a pose. */
export function indexOf(role: Role): number {
  return NUMBERS.get(role)!;
}

/** Index of the same role on the other side; roles in the middle are their own mirror images. */
export function mirroredRole(number: number): number {
  const swapped = ROLES[number]!.replace(/^(left|right)_/, (_, side) => (side === 'left' ? 'right_' : 'left_'));
  return NUMBERS.get(swapped)!;
}
