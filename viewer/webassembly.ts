import { readFile } from 'node:fs/promises';
import { basename, dirname, join } from 'node:path';
import asc from 'assemblyscript/asc';
import type { Plugin } from 'vite';

const QUERY = '?wasm-bytes';
const OPTIONS = ['-O3', '--converge', '--enable', 'simd', '--runtime', 'stub', '--noAssert', '--uncheckedBehavior', 'always'];

/** Compiles what is imported as `FILE.ts?wasm-bytes` from AssemblyScript to WebAssembly, and gives its bytes as base64. */
export function webAssembly(): Plugin {
  return {
    name: 'webassembly',
    enforce: 'pre',
    async load(id) {
      if (!id.endsWith(QUERY)) return undefined;
      const { bytes, sources } = await compile(id.slice(0, -QUERY.length));
      for (const source of sources) this.addWatchFile(source);
      return { code: `export default ${JSON.stringify(Buffer.from(bytes).toString('base64'))};`, map: null, moduleType: 'js' };
    },
  };
}

async function compile(path: string): Promise<{ bytes: Uint8Array; sources: string[] }> {
  const folder = dirname(path);
  const sources: string[] = [];
  let bytes: Uint8Array | null = null;
  const { error, stderr } = await asc.main([basename(path), '--outFile', 'out.wasm', ...OPTIONS], {
    readFile: async (name) => {
      const source = join(folder, name);
      const text = await readFile(source, 'utf8').catch(() => null);
      if (text !== null) sources.push(source);
      return text;
    },
    writeFile: (_, contents) => void (bytes = contents as Uint8Array),
    listFiles: () => [],
  });
  if (error ?? !bytes) throw new Error(`${path} cannot be compiled:\n${stderr.toString()}`);
  return { bytes: bytes!, sources };
}
