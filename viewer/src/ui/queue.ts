import type { PlaceMessage } from '../protocol.ts';
import { say, type Message } from '../words/text.ts';

const HOUR = 60; // min

/** A place in the queue as a sentence, such as "You are number 3. About 2 minutes." */
export function inWords({ position, seconds }: Pick<PlaceMessage, 'position' | 'seconds'>): Message {
  const place = position === 1 ? say('queue.next') : say('queue.place', { place: position });
  return seconds === null ? place : duration(place, seconds / 60);
}

function duration(place: Message, minutes: number): Message {
  if (minutes < 0.75) return say('queue.under', { place });
  const whole = Math.round(minutes);
  if (whole >= HOUR) return say('queue.over', { place });
  return say('queue.minutes', { place, n: whole < 20 ? whole : 5 * Math.round(minutes / 5) });
}
