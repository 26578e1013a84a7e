import { readFile, writeFile } from 'node:fs/promises';
import { extname, join } from 'node:path';
import { promisify } from 'node:util';
import { brotliCompress, constants, gzip } from 'node:zlib';
import type { Plugin } from 'vite';

const TEXT = new Set(['.css', '.html', '.js', '.json', '.svg', '.wasm']);

/** Ways to write a file smaller, by the suffix under which `ico3d/chat/serving/page_files.py` looks for it. */
const ENCODINGS: Record<string, (file: Buffer) => Promise<Buffer>> = {
  '.br': (file) => promisify(brotliCompress)(file, { params: { [constants.BROTLI_PARAM_SIZE_HINT]: file.length } }),
  '.gz': (file) => promisify(gzip)(file, { level: 9 }),
};

/** Writes each text file of the built page compressed beside itself, where that makes it smaller. */
export function compressed(): Plugin {
  return {
    name: 'compressed',
    apply: 'build',
    async writeBundle({ dir }, bundle) {
      const paths = Object.keys(bundle).filter((name) => TEXT.has(extname(name))).map((name) => join(dir!, name));
      await Promise.all(paths.map(compress));
    },
  };
}

async function compress(path: string): Promise<void> {
  const file = await readFile(path);
  for (const [suffix, encode] of Object.entries(ENCODINGS)) {
    const small = await encode(file);
    if (small.length < file.length) await writeFile(path + suffix, small);
  }
}
