import { mkdtempSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { startForks } from './python.ts';

/** Makes the folder of all scratch folders of a run, and forks for its scripts; they vanish with the run (vitest's `globalSetup`). */
export default async function scratchRoot(): Promise<() => void> {
  const root = mkdtempSync(join(tmpdir(), 'ico3d-viewer-'));
  process.env.ICO3D_SCRATCH = root; // the workers, which end without a chance to clean up, inherit it
  const end = await startForks(join(root, 'forks'));
  return () => {
    end();
    rmSync(root, { recursive: true, force: true });
  };
}

/** A folder that vanishes with the run of the tests. */
export function scratchFolder(): string {
  return mkdtempSync(join(process.env.ICO3D_SCRATCH ?? tmpdir(), 'scratch-'));
}
