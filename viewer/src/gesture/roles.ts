import { ROLES } from '../shared.ts';

/** What a joint is to gestures: `hips`, `left_elbow` … */
export type Role = (typeof ROLES)[number];
export type Side = 'left' | 'right';

export const SIDES = ['left', 'right'] as const;

const NUMBERS = new Map<string, number>(ROLES.map((role, number) => [role, number]));

/** Number of a role in a pose; undefined if there is none of that name. */
export function findRole(name: string): number | undefined {
  return NUMBERS.get(name);
}

/** Number of a role in a pose. */
export function indexOf(role: Role): number {
  return NUMBERS.get(role)!;
}

/** Number of the same role on the other side. */
export function mirroredRole(number: number): number {
  const swapped = ROLES[number]!.replace(/^(left|right)_/, (_, side) => (side === 'left' ? 'right_' : 'left_'));
  return NUMBERS.get(swapped)!;
}
