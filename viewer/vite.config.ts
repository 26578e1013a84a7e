import { defineConfig } from 'vitest/config';
import { compressed } from './compression.ts';

// `npm run dev` shows the page against a running `ico3d serve … --port 8700`.
const SERVER = process.env.ICO3D_SERVER ?? 'http://127.0.0.1:8700';

export default defineConfig({
  base: './',
  plugins: [compressed()],
  build: {
    outDir: '../src/ico3d/chat/static',
    emptyOutDir: true,
    target: 'es2023',
    rolldownOptions: {
      input: { index: 'index.html', check: 'check.html', embed: 'src/embed/served.ts' },
      preserveEntrySignatures: 'exports-only', // of what other sites import
      // Other sites write its address into their pages: it stays, and imports what changes.
      output: { entryFileNames: ({ name }) => (name === 'embed' ? 'embed.js' : 'assets/[name]-[hash].js') },
      checks: { pluginTimings: false }, // to compress well takes its time
    },
    chunkSizeWarningLimit: 4000, // three and Spark (with its sort worker) in one file
  },
  server: {
    proxy: { '/bundle': SERVER, '/health': SERVER, '/echo': { target: SERVER, ws: true }, '/ws': { target: SERVER, ws: true } },
  },
  test: {
    globalSetup: 'support/scratch.ts',
    isolate: false, // loading three and Spark anew for each file takes longer than most of the tests
    projects: [
      { extends: true, test: { name: 'unit', include: ['test/**/*.test.ts'] } },
      {
        extends: true,
        test: {
          name: 'e2e',
          include: ['e2e/*.spec.ts', 'e2e/talk/*.spec.ts'],
          globalSetup: ['support/scratch.ts', 'support/servers/shared.ts'],
          maxWorkers: 2, // much of a talk is waiting
          sequence: { groupOrder: 1 },
          testTimeout: 120_000,
          hookTimeout: 120_000,
        },
      },
      {
        extends: true,
        test: {
          name: 'e2e alone',
          include: ['e2e/alone/*.spec.ts'], // these judge milliseconds: nothing else may load the machine
          maxWorkers: 1,
          sequence: { groupOrder: 2 },
          testTimeout: 120_000,
          hookTimeout: 120_000,
        },
      },
      { extends: true, test: { name: 'bench', include: ['bench/*.ts'], testTimeout: 600_000 } },
    ],
  },
});
