import { atEnd } from '../lifetime.ts';

/**
 * Tells whether a canvas can be seen, whenever that changes: its page lies in front, and some of it is
 * scrolled into view. Until the signal.
 */
export function watchSight(canvas: HTMLCanvasElement, changed: (seen: boolean) => void, signal: AbortSignal): void {
  const page = canvas.ownerDocument;
  let scrolledTo = true;
  const tell = () => changed(scrolledTo && page.visibilityState === 'visible');
  const observer = new IntersectionObserver((entries) => {
    scrolledTo = entries.at(-1)!.isIntersecting;
    tell();
  });
  observer.observe(canvas);
  page.addEventListener('visibilitychange', tell, { signal });
  atEnd(signal, () => observer.disconnect());
}
