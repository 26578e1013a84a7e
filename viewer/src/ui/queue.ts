import type { PlaceMessage } from '../protocol.ts';

const ORDINALS = ['next', 'second', 'third', 'fourth', 'fifth', 'sixth', 'seventh', 'eighth', 'ninth', 'tenth'];
const NUMBERS = ['one', 'two', 'three', 'four', 'five', 'six', 'seven', 'eight', 'nine', 'ten'];
const HOUR = 60; // min

/** A place in the queue as a sentence, such as "You are third; about two minutes." */
export function inWords({ position, seconds }: Pick<PlaceMessage, 'position' | 'seconds'>): string {
  const place = ORDINALS[position - 1] ?? `number ${position}`;
  return `You are ${place}${seconds === null ? '' : `; ${duration(seconds / 60)}`}.`;
}

function duration(minutes: number): string {
  if (minutes < 0.75) return 'less than a minute';
  if (minutes < 1.5) return 'about a minute';
  const whole = Math.round(minutes);
  if (whole >= HOUR) return 'more than an hour';
  return `about ${NUMBERS[whole - 1] ?? (minutes < 20 ? whole : 5 * Math.round(minutes / 5))} minutes`;
}
