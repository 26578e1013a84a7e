import { mkdtempSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';

/** A folder that vanishes with the test process. */
export function scratchFolder(): string {
  const folder = mkdtempSync(join(tmpdir(), 'ico3d-viewer-'));
  process.on('exit', () => rmSync(folder, { recursive: true, force: true }));
  return folder;
}
