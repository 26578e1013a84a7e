import html from '../../index.html?raw';
import pageStyle from '../style.css?inline';
import frameStyle from './frame.css?inline';
import { PageWords } from '../words/page-words.ts';
import { say } from '../words/text.ts';

const ROOT_SIZE = 16; // px: sizes are those of the page, whatever the font size of the page around it

/** What an embedded avatar is made of. */
export interface Shell {
  launcher: HTMLButtonElement; // of the floating mode
  /** Holds the elements of `index.html`. */
  page: HTMLElement;
  words: PageWords;
}

/** Builds an embedded avatar in a shadow root. */
export function buildShell(root: ShadowRoot): Shell {
  const style = document.createElement('style');
  style.textContent = (pageStyle + frameStyle).replace(/([\d.]+)rem\b/g, (_, size) => `${ROOT_SIZE * Number(size)}px`);
  const launcher = document.createElement('button');
  launcher.id = 'launcher';
  launcher.setAttribute('aria-controls', 'page');
  const holder = document.createElement('section');
  holder.id = 'page';
  holder.className = 'page';
  holder.tabIndex = -1; // keeps the focus while its contents change
  root.replaceChildren(style, holder, launcher);
  const words = new PageWords(root);
  words.write(launcher, say('about.launcher'), 'label');
  words.write(holder, say('about.avatar'), 'label');
  return { launcher, page: holder, words };
}

/**
 * Fills the page anew, as nobody has touched it.
 *
 * @param server address that the page's links are relative to; null if there is none
 */
export function fillPage({ page: holder, words }: Shell, server: URL | null): void {
  holder.replaceChildren(...new DOMParser().parseFromString(html, 'text/html').body.children);
  delete holder.dataset.state;
  delete holder.dataset.drawer;
  delete holder.dataset.there;
  delete holder.dataset.sheet;
  words.translate();
  for (const link of holder.querySelectorAll<HTMLAnchorElement>('a[href]')) link.href = server ? new URL(link.getAttribute('href')!, server).href : '';
}
