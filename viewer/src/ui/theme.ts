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
  const system = matchMedia(LIGHT);
  const button = document.createElement('button');
  button.type = 'button';
  button.className = 'round quiet theme';
  const show = (chosen = remembered(KEY)) => {
    const light = (chosen ?? (system.matches ? 'light' : 'dark')) === 'light';
    root.dataset.theme = light ? 'light' : 'dark';
    words.name(button, say(light ? 'theme.dark' : 'theme.light'));
    button.replaceChildren(icon(light ? 'moon' : 'sun'));
    changed(light);
  };
  button.onclick = () => {
    const theme = root.dataset.theme === 'light' ? 'dark' : 'light';
    remember(KEY, theme);
    show(theme);
  };
  system.addEventListener('change', () => show(), { signal });
  show();
  return button;
}
