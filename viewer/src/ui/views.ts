import { VIEWS, type View } from '../stage/camera/framing.ts';
import type { Orbit } from '../stage/camera/orbit.ts';
import { icon } from './icons.ts';

const NAMES: Record<View, string> = { face: 'Face', half: 'Head and chest', whole: 'Whole figure' };

/**
 * A button for each view of somebody; their numbers are keys, wherever nothing is typed.
 *
 * @param keys where keys are heard: the page, or a part of it
 */
export function makeViewBar(orbit: Orbit, keys: EventTarget, signal: AbortSignal): HTMLElement {
  const bar = document.createElement('div');
  bar.className = 'views';
  bar.setAttribute('role', 'group');
  bar.setAttribute('aria-label', 'View');
  const views = VIEWS.filter((view) => orbit.views.includes(view));
  bar.hidden = views.length < 2;
  const buttons = views.map((view) => makeButton(view, orbit));
  bar.append(...buttons);
  const show = (shown: View | null) =>
    views.forEach((view, i) => buttons[i]!.setAttribute('aria-pressed', String(view === shown)));
  show(orbit.view);
  orbit.onView = show;
  const press = (event: Event) => {
    const view = VIEWS[Number((event as KeyboardEvent).key) - 1];
    if (view && !isForOthers(event as KeyboardEvent)) orbit.show(view);
  };
  keys.addEventListener('keydown', press, { signal });
  return bar;
}

function makeButton(view: View, orbit: Orbit): HTMLButtonElement {
  const button = document.createElement('button');
  const key = String(VIEWS.indexOf(view) + 1);
  button.type = 'button';
  button.className = 'round quiet';
  button.title = `${NAMES[view]} (${key})`;
  button.setAttribute('aria-label', NAMES[view]);
  button.setAttribute('aria-keyshortcuts', key);
  button.append(icon(view));
  button.onclick = () => orbit.show(view);
  return button;
}

/** Whether a key is typed into a text, or is meant for the browser. */
function isForOthers(event: KeyboardEvent): boolean {
  if (event.ctrlKey || event.metaKey || event.altKey) return true;
  const target = event.composedPath()[0] as Element;
  return target.closest?.('textarea, select, [contenteditable], input:not([type=radio], [type=range])') != null;
}
