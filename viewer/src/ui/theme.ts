import { remember, remembered } from '../remembered.ts';
import type { PageWords } from '../words/page-words.ts';
import { say } from '../words/text.ts';
import { icon } from './icons.ts';

const KEY = 'theme';
const LIGHT = '(prefers-color-scheme: light)';

/**
 * A button for light and dark; at first the page is as the visitor's system is, then as they chose.
 *
 * @param root what is light or dark (`data-theme`)
 * @param changed is told at once, and whenever it changes
 */
export function makeThemeButton(
  root: HTMLElement,
  words: PageWords,
  changed: (light: boolean) => void,
  signal: AbortSignal,
): HTMLButtonElement {
  const button = document.createElement('button');
  button.type = 'button';
  button.className = 'round quiet theme';
  const show = (theme: string) => {
    const light = theme === 'light';
    words.name(button, say(light ? 'theme.dark' : 'theme.light'));
    button.replaceChildren(icon(light ? 'moon' : 'sun'));
    changed(light);
  };
  button.onclick = () => {
    const theme = root.dataset.theme === 'light' ? 'dark' : 'light';
    remember(KEY, theme);
    show(showTheme(root, theme));
  };
  followTheme(root, show, signal);
  return button;
}

/**
 * Makes an element light or dark, now and whenever the visitor's system changes.
 *
 * @param changed is told at once, and whenever that happens, which of them it is
 */
export function followTheme(root: HTMLElement, changed: (theme: string) => void, signal: AbortSignal): void {
  matchMedia(LIGHT).addEventListener('change', () => changed(showTheme(root)), { signal });
  changed(showTheme(root));
}

/**
 * Makes an element light or dark; which of them.
 *
 * @param chosen by default what the visitor chose before; without a choice it is as their system is
 */
export function showTheme(root: HTMLElement, chosen = remembered(KEY)): string {
  const light = chosen ? chosen === 'light' : matchMedia(LIGHT).matches;
  return (root.dataset.theme = light ? 'light' : 'dark');
}
