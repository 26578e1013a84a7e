import { cpus, loadavg } from 'node:os';

/** How much longer things take by the real clock on a machine that does other things besides. */
export function slowness(): number {
  return Math.max(1, (2 * loadavg()[0]!) / cpus().length);
}
