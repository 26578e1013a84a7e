import { readFile, rm, writeFile } from 'node:fs/promises';
import { join } from 'node:path';
import { defineConfig, type Plugin } from 'vite';
import { webAssembly } from './webassembly.ts';

/** `npm pack` builds the package with it: the element and the renderer, without three and Spark. */
export default defineConfig({
  plugins: [webAssembly(), embedded()],
  worker: { format: 'es', plugins: () => [webAssembly()] },
  build: {
    outDir: 'dist',
    target: 'es2023',
    lib: { entry: { index: 'src/embed/index.ts' }, formats: ['es'] },
    rolldownOptions: {
      external: /^(three|@sparkjsdev\/spark)(\/|$)/,
      output: { chunkFileNames: '[name]-[hash].js' },
    },
  },
});

/** Puts the microphone's worklet into the script: bundlers disagree on how packages refer to files of their own. */
function embedded(): Plugin {
  return {
    name: 'embedded worklets',
    async writeBundle({ dir }, bundle) {
      const chunks = Object.keys(bundle).filter((name) => bundle[name]!.type === 'chunk').map((name) => join(dir!, name));
      for (const name of Object.keys(bundle).filter((name) => bundle[name]!.type === 'asset')) {
        const worklet = await readFile(join(dir!, name), 'utf8');
        await replace(chunks, name, `URL.createObjectURL(new Blob([${JSON.stringify(worklet)}],{type:"text/javascript"}))`);
        await rm(join(dir!, name));
      }
    },
  };
}

/** Writes an expression in place of each address of a file. */
async function replace(chunks: string[], file: string, expression: string): Promise<void> {
  for (const chunk of chunks) {
    const code = await readFile(chunk, 'utf8');
    await writeFile(chunk, code.replaceAll(`"/${file}"`, () => expression));
  }
}
