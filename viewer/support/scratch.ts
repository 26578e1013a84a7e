import { mkdtempSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';

/** Makes the folder of all scratch folders of a run; it vanishes with the run (vitest's `globalSetup`). */
export default function scratchRoot(): () => void {
  const root = mkdtempSync(join(tmpdir(), 'ico3d-viewer-'));
  process.env.ICO3D_SCRATCH = root; // the workers, which end without a chance to clean up, inherit it
  return () => rmSync(root, { recursive: true, force: true });
}

/** A folder that vanishes with the run of the tests. */
export function scratchFolder(): string {
  return mkdtempSync(join(process.env.ICO3D_SCRATCH ?? tmpdir(), 'scratch-'));
}
