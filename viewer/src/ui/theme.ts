import { icon } from './icons.ts';

const KEY = 'ico3d-theme';
const LIGHT = '(prefers-color-scheme: light)';

/**
 * A button for light and dark; at first the page is as the visitor's system is, then as they chose.
 *
 * @param root what is light or dark (`data-theme`)
 * @param changed is told at once, and whenever it changes
 */
export function makeThemeButton(root: HTMLElement, changed: (light: boolean) => void, signal: AbortSignal): HTMLButtonElement {
  const system = matchMedia(LIGHT);
  const button = document.createElement('button');
  button.type = 'button';
  button.className = 'round quiet theme';
  const show = () => {
    const light = showTheme(root) === 'light';
    button.title = light ? 'Make it dark' : 'Make it light';
    button.setAttribute('aria-label', button.title);
    button.replaceChildren(icon(light ? 'moon' : 'sun'));
    changed(light);
  };
  button.onclick = () => {
    choose(root.dataset.theme === 'light' ? 'dark' : 'light');
    show();
  };
  system.addEventListener('change', show, { signal });
  show();
  return button;
}

/** Makes an element light or dark as the visitor chose, else as their system is; which of them. */
export function showTheme(root: HTMLElement): string {
  return (root.dataset.theme = chosen() ?? (matchMedia(LIGHT).matches ? 'light' : 'dark'));
}

/** What the visitor chose; null where they did not, or the browser keeps nothing. */
function chosen(): string | null {
  try {
    return localStorage.getItem(KEY);
  } catch {
    return null;
  }
}

function choose(theme: string): void {
  try {
    localStorage.setItem(KEY, theme);
  } catch {
    // It holds until the page is left.
  }
}
