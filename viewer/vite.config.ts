import { defineConfig } from 'vitest/config';
import { compressed } from './compression.ts';
import { preloaded } from './preloading.ts';
import { PATIENCE } from './support/patience.ts';
import { themed } from './theming.ts';
import { webAssembly } from './webassembly.ts';

// `npm run dev` shows the page against a running `ico3d serve … --port 8700`.
const SERVER = process.env.ICO3D_SERVER ?? 'http://127.0.0.1:8700';

export default defineConfig({
  base: './',
  plugins: [webAssembly(), compressed(), preloaded('index.html', 'theatre'), themed({ 'index.html': 'body', 'check.html': 'documentElement', 'studio.html': 'documentElement' })],
  worker: { format: 'es', plugins: () => [webAssembly()] },
  build: {
    outDir: '../src/ico3d/chat/static',
    emptyOutDir: true,
    target: 'es2023',
    rolldownOptions: {
      input: { index: 'index.html', check: 'check.html', studio: 'studio.html', embed: 'src/embed/served.ts' },
      preserveEntrySignatures: 'exports-only', // of what other sites import
      // Other sites write its address into their pages: it stays, and imports what changes.
      output: {
        entryFileNames: ({ name }) => (name === 'embed' ? 'embed.js' : 'assets/[name]-[hash].js'),
        // Side by side, and kept by browsers when only the page itself has changed.
        codeSplitting: {
          groups: [
            { name: 'three', test: /three\/build\/three\.core/, priority: 2 },
            { name: 'three-webgl', test: /three\/build\/three\.module/, priority: 1 }, // its renderer
            { name: 'spark', test: /node_modules\/@sparkjsdev\// },
          ],
        },
      },
      checks: { pluginTimings: false }, // to compress well takes its time
    },
    chunkSizeWarningLimit: 3000, // Spark, with its sort worker
  },
  server: {
    proxy: { '/bundle': SERVER, '/recordings': SERVER, '/health': SERVER, '/echo': { target: SERVER, ws: true }, '/ws': { target: SERVER, ws: true } },
  },
  test: {
    globalSetup: 'support/scratch.ts',
    isolate: false, // loading three and Spark anew for each file takes longer than most of the tests
    testTimeout: 3 * PATIENCE,
    hookTimeout: 3 * PATIENCE,
    expect: { poll: { timeout: PATIENCE, interval: 100 } },
    projects: [
      { extends: true, test: { name: 'unit', include: ['test/**/*.test.ts'] } },
      {
        extends: true,
        test: {
          name: 'e2e',
          include: ['e2e/**/*.spec.ts'],
          exclude: ['e2e/alone/**'],
          globalSetup: ['support/scratch.ts', 'support/servers/shared.ts'],
          maxWorkers: 2, // much of a talk is waiting
          sequence: { groupOrder: 1 },
        },
      },
      {
        extends: true,
        test: {
          name: 'e2e alone',
          include: ['e2e/alone/*.spec.ts'], // these judge milliseconds: nothing else may load the machine
          maxWorkers: 1,
          sequence: { groupOrder: 2 },
        },
      },
      {
        extends: true,
        test: {
          name: 'pictures',
          include: ['bench/pictures/*.spec.ts'],
          globalSetup: ['support/scratch.ts', 'support/servers/shared.ts'],
          maxWorkers: 1,
        },
      },
      {
        extends: true,
        test: {
          name: 'bench',
          include: ['bench/*.ts', 'bench/soft/*.ts'],
          maxWorkers: 1, // one after the other: all of them measure the machine
          testTimeout: 900_000,
        },
      },
    ],
  },
});
