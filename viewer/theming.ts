import type { Plugin } from 'vite';

/** What of `document` is light or dark, by the HTML file. */
type Roots = Record<string, 'body' | 'documentElement'>;

const NAME = 'first-theme.js';

/** Does at once what `showTheme` of `src/ui/theme.ts` does later on; storage may be forbidden. */
const SCRIPT = `{
  let chosen;
  try {
    chosen = localStorage.getItem('ico3d-theme');
  } catch {}
  const light = chosen ? chosen === 'light' : matchMedia('(prefers-color-scheme: light)').matches;
  document[document.currentScript.dataset.root].dataset.theme = light ? 'light' : 'dark';
}
`;

/**
 * Makes pages light or dark before their first paint, long before their own script is there: as the visitor chose, else
 * as their system is. It is a file of its own, which the page waits for: servers forbid scripts within pages.
 */
export function themed(roots: Roots): Plugin {
  let built = false;
  return {
    name: 'themed',
    configResolved: ({ command }) => void (built = command === 'build'),
    buildStart() {
      if (built) this.emitFile({ type: 'asset', name: NAME, source: SCRIPT });
    },
    transformIndexHtml: {
      order: 'post',
      handler: (_, { path, bundle }) => {
        const root = roots[path.slice(1)];
        if (!root) return [];
        const file = Object.values(bundle ?? {}).find((part) => part.type === 'asset' && part.names.includes(NAME));
        const script = { attrs: { src: file && `./${file.fileName}`, 'data-root': root }, children: file ? '' : SCRIPT };
        return [{ tag: 'script', injectTo: 'body-prepend', ...script }];
      },
    },
  };
}
