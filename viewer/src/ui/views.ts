import { VIEWS, type View } from '../stage/camera/framing.ts';
import type { Orbit } from '../stage/camera/orbit.ts';
import type { PageWords } from '../words/page-words.ts';
import { say } from '../words/text.ts';
import { icon } from './icons.ts';
import { isForOthers, KEYS } from './keyboard/keys.ts';

/**
 * A button for each view of somebody; their numbers are keys, wherever nothing is typed.
 *
 * @param keys where keys are heard: the page, or a part of it
 */
export function makeViewBar(orbit: Orbit, words: PageWords, keys: EventTarget, signal: AbortSignal): HTMLElement {
  const bar = document.createElement('div');
  bar.className = 'views';
  bar.setAttribute('role', 'group');
  words.write(bar, say('view'), 'label');
  const views = VIEWS.filter((view) => orbit.views.includes(view));
  bar.hidden = views.length < 2;
  const buttons = views.map((view) => makeButton(view, orbit, words));
  bar.append(...buttons);
  const show = (shown: View | null) =>
    views.forEach((view, i) => buttons[i]!.setAttribute('aria-pressed', String(view === shown)));
  show(orbit.view);
  orbit.onView = show;
  const press = (event: Event) => {
    const view = VIEWS[KEYS.view.indexOf((event as KeyboardEvent).key)];
    if (view && !isForOthers(event as KeyboardEvent)) orbit.show(view);
  };
  keys.addEventListener('keydown', press, { signal });
  return bar;
}

function makeButton(view: View, orbit: Orbit, words: PageWords): HTMLButtonElement {
  const button = document.createElement('button');
  const key = KEYS.view[VIEWS.indexOf(view)]!;
  button.type = 'button';
  button.className = 'round quiet';
  const name = say(`view.${view}`);
  words.name(button, name, say('keyed', { name, key }));
  button.setAttribute('aria-keyshortcuts', key);
  button.append(icon(view));
  button.onclick = () => orbit.show(view);
  return button;
}
