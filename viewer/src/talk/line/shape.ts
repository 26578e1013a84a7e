import type { Fields, Shape } from './fields.ts';

/** Whether a value that was read from JSON is what it must be; it may hold more fields than those. */
export function fits(value: unknown, shape: Shape): boolean {
  if (shape === 'integer') return Number.isSafeInteger(value);
  if (shape === 'number') return Number.isFinite(value); // 1e999 is read as infinity
  if (typeof shape === 'string') return typeof value === shape;
  if ('maybe' in shape) return value === null || fits(value, shape.maybe);
  if ('words' in shape) return shape.words.includes(value as string);
  if ('list' in shape) return Array.isArray(value) && value.every((one) => fits(one, shape.list));
  if ('pair' in shape) return Array.isArray(value) && value.length === 2 && shape.pair.every((one, i) => fits(value[i], one));
  if (typeof value !== 'object' || value === null || Array.isArray(value)) return false;
  if ('record' in shape) return Object.values(value).every((one) => fits(one, shape.record));
  return Object.entries(shape.fields satisfies Fields).every(([name, one]) => Object.hasOwn(value, name) && fits((value as Record<string, unknown>)[name], one));
}
