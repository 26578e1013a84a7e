import type { Status } from '../recordings.ts';
import { isAgreed, UPLOAD } from './parts.ts';

/** The part that is to be recorded next: the first that was not yet; the consent, which is the first of all, if all were. */
export function nextPart({ parts }: Status): string {
  const open = parts.filter(({ id, state }) => id !== UPLOAD && state !== 'kept');
  return (open[0] ?? parts[0]!).id;
}

/** Whether a part may be chosen: before the consent is kept only that, and a video that was brought only if there is one. */
export function mayChoose({ parts }: Status, part: string | null): part is string {
  return parts.some(({ id, state }) => id === part && (isAgreed(parts) || id === 'consent') && (id !== UPLOAD || state === 'kept'));
}

/** Whether there is a video that takes the place of the parts. */
export function isBrought({ parts }: Status): boolean {
  return parts.some(({ id, state }) => id === UPLOAD && state === 'kept');
}

/** Whether all parts are recorded. */
export function isComplete({ parts }: Status): boolean {
  return parts.every(({ id, state }) => id === UPLOAD || state === 'kept');
}

/** Whether an avatar can be made. */
export function isReady({ parts }: Status): boolean {
  return isAgreed(parts) && parts.filter(({ state }) => state === 'kept').length > 1;
}

/** Whether an avatar can be made that would hardly be better of more. */
export function isEnough(status: Status): boolean {
  const { covered } = status;
  return isReady(status) && (isBrought(status) || covered.seconds >= covered.enough);
}
