import { cpus, loadavg } from 'node:os';

const MOMENT = 50; // ms of work

/** How much longer things take by the real clock on a machine that does other things besides, in the last minute or just now. */
export function slowness(): number {
  return Math.max(1, (2 * loadavg()[0]!) / cpus().length, waiting());
}

/** How much longer a moment of work takes than the processor works on it: the load of the last minute knows nothing of what has just begun. */
function waiting(): number {
  const [begun, before] = [performance.now(), process.cpuUsage()];
  const worked = () => {
    const { user, system } = process.cpuUsage(before);
    return (user + system) / 1000;
  };
  while (worked() < MOMENT);
  return (performance.now() - begun) / worked();
}
