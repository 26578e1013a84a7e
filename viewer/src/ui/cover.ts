import { atEnd } from '../lifetime.ts';
import { byId } from './elements.ts';

const MUCH = 0.1; // of the picture's height, which is a gap when it stays free
const CALM = 4000; // ms for which it does
const PASSING = new Set(['captions', 'stop', 'silenced']); // what comes and goes with what is said
const OVER = new Set(['notices', 'line']); // what lies over the picture for a while, and moves nobody
const NARROW = 480; // pixels of width from which heads are beside what is written in the corner
const SETTLING = 1000; // ms after a change of the picture's size, in which all finds its place

/**
 * Tells how many pixels at the lower edge the controls and captions cover, whenever they cover more
 * than before in a picture of this size: what was there once comes again, and the picture must not
 * jump each time. `controls` are those under the captions, `words` what is over the buttons of the views
 * in a narrow picture, where hair would reach as far as words go. Much that stays free for some seconds is
 * given back. Notices do not count; they go.
 */
export function watchCover(root: ParentNode, signal: AbortSignal, changed: (pixels: number, controls: number, words: number) => void): void {
  const main = root.querySelector('main')!;
  const picture = byId(root, 'stage');
  let size = '';
  let most = 0;
  let sized = 0; // when the picture got its size, ms
  let freeing: ReturnType<typeof setTimeout> | undefined;
  const measure = () => {
    const before = size;
    const { width, height, top, bottom } = picture.getBoundingClientRect();
    size = `${width}x${height}`;
    const covers = [...main.children].filter(isCover);
    const under = (elements: readonly Element[]) => Math.max(0, ...elements.map((element) => bottom - element.getBoundingClientRect().top));
    const [covered, controls] = [under(covers), under(covers.filter(({ id }) => !PASSING.has(id)))];
    clearTimeout(freeing);
    const take = () => {
      most = covered;
      changed(most, controls, width < NARROW ? overViews(root) - top : 0);
    };
    if (size !== before) sized = performance.now();
    if (performance.now() - sized < SETTLING || covered > most) take();
    else if (most - covered > MUCH * height) freeing = setTimeout(take, CALM);
  };
  const observer = new ResizeObserver(measure);
  for (const child of main.children) observer.observe(child);
  observer.observe(picture);
  atEnd(signal, () => {
    observer.disconnect();
    clearTimeout(freeing);
  });
}

/** Where the buttons of the views begin, which leave room for the longest words over them; the upper edge without buttons. */
function overViews(root: ParentNode): number {
  return root.querySelector('.views')?.getBoundingClientRect().top ?? 0;
}

/** Whether an element is seen and lies in the row of the face, not beside it. */
function isCover(element: Element): boolean {
  const { width, height } = element.getBoundingClientRect();
  const seen = width > 0 && height > 0 && !element.matches('.gone');
  return seen && !OVER.has(element.id) && getComputedStyle(element).position !== 'fixed';
}
