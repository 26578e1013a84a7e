import { existsSync } from 'node:fs';
import { join } from 'node:path';
import type { TestProject } from 'vitest/node';
import { runPython } from '../python.ts';
import { scratchFolder } from '../scratch.ts';
import { ChatServer } from './server.ts';

/** The avatar that comes in the package. */
const DEMO = join(import.meta.dirname, '../../../src/ico3d/chat/data/demo.ico3d');

/** What all browser tests share; the servers have default settings. */
export interface Shared {
  talking: string; // bundle of a small random head with the persona of `persona.json`
  talkingUrl: string; // of a server of that bundle
  demo: string | null; // the packaged bundle, where there is one
  demoUrl: string | null;
}

declare module 'vitest' {
  interface ProvidedContext {
    shared: Shared;
  }
}

/** Starts what several files of tests ask the same of, once for all of them (vitest's `globalSetup`). */
export default async function setup(project: TestProject): Promise<() => Promise<void>> {
  const talking = join(scratchFolder(), 'talking.ico3d');
  runPython('references/talking_bundle.py', talking);
  const demo = existsSync(DEMO) ? DEMO : null;
  const servers = await Promise.all([talking, demo].map((bundle) => bundle && ChatServer.start(bundle)));
  const [talkingUrl, demoUrl] = servers.map((server) => server && server.url);
  project.provide('shared', { talking, talkingUrl: talkingUrl!, demo, demoUrl: demoUrl ?? null });
  return async () => {
    await Promise.all(servers.map((server) => server && server.stop()));
  };
}
