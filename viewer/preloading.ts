import type { HtmlTagDescriptor, Plugin, Rolldown } from 'vite';

type OutputChunk = Rolldown.OutputChunk;

/**
 * Lets a page ask at once for a chunk that its script imports later, and for what that chunk imports.
 *
 * @param page HTML file
 * @param chunk name of the chunk
 */
export function preloaded(page: string, chunk: string): Plugin {
  return {
    name: 'preloaded',
    apply: 'build',
    transformIndexHtml: {
      order: 'post',
      handler: (html, { path, bundle }) =>
        path === `/${page}` && bundle
          ? withImports(bundle, chunk).filter((file) => !html.includes(file)).map(preload)
          : [],
    },
  };
}

function preload(file: string): HtmlTagDescriptor {
  return { tag: 'link', attrs: { rel: 'modulepreload', crossorigin: true, href: `./${file}` }, injectTo: 'head' };
}

/** Names of a chunk's file and of all files that it imports. */
function withImports(bundle: Rolldown.OutputBundle, name: string): string[] {
  const chunks = Object.values(bundle).filter((part): part is OutputChunk => part.type === 'chunk');
  const files = new Set<string>();
  const visit = (chunk: OutputChunk | undefined) => {
    if (!chunk || files.has(chunk.fileName)) return;
    files.add(chunk.fileName);
    for (const file of chunk.imports) visit(chunks.find(({ fileName }) => fileName === file));
  };
  visit(chunks.find((part) => part.name === name));
  if (files.size === 0) throw new Error(`No chunk is named ${name}.`);
  return [...files];
}
