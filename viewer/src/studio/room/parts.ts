import type { PageWords } from '../../words/page-words.ts';
import { say } from '../../words/text.ts';
import { partName, type Part } from '../recordings.ts';

/** The part that is a video which somebody brought instead of recording. */
export const UPLOAD = 'upload';

/**
 * Shows the list of parts: each is chosen by pressing it, and none but the consent before that is kept.
 *
 * @param current the part that is chosen
 */
export function showParts(list: HTMLElement, words: PageWords, parts: readonly Part[], current: string, select: (id: string) => void): void {
  const agreed = isAgreed(parts);
  const entries = parts.filter(isListed).map((part) => {
    const [row, button, name, state] = (['li', 'button', 'span', 'span'] as const).map((tag) => document.createElement(tag));
    words.write(name!, partName(part.id));
    const shown = part.advice?.length ? 'better' : part.state;
    words.write(state!, say(`studio.state.${shown}`, part.seconds === undefined ? undefined : { n: Math.round(10 * part.seconds) / 10 }));
    button!.dataset.part = part.id;
    button!.dataset.state = part.state;
    button!.dataset.shown = shown;
    button!.ariaPressed = String(part.id === current);
    (button as HTMLButtonElement).disabled = part.id !== 'consent' && !agreed;
    button!.append(name!, state!);
    button!.onclick = () => select(part.id);
    row!.append(button!);
    return row!;
  });
  list.replaceChildren(...entries);
}

/** Whether the person said that they agree: that comes before all else. */
export function isAgreed(parts: readonly Part[]): boolean {
  return parts.some(({ id, state }) => id === 'consent' && state === 'kept');
}

/** Whether a part is listed: a video that was brought only if there is one. */
function isListed({ id, state }: Part): boolean {
  return id !== UPLOAD || state !== 'missing';
}
