import { readdirSync, readFileSync } from 'node:fs';

const TICKS = 100; // per second: the unit in which Linux counts

/** Processor time that all descendants of this process have used so far, s (Linux). */
export function processorTime(): number {
  const processes = new Map(readdirSync('/proc').filter((name) => /^\d+$/.test(name)).map((pid) => [pid, read(pid)]));
  const descends = (pid: string): boolean => {
    const parent = processes.get(pid)?.parent;
    return parent !== undefined && (parent === String(process.pid) || descends(parent));
  };
  const ours = [...processes].filter(([pid]) => descends(pid));
  return ours.reduce((sum, [, found]) => sum + (found?.seconds ?? 0), 0);
}

/** Parent and processor time of one process; undefined if it has ended. */
function read(pid: string): { parent: string; seconds: number } | undefined {
  try {
    const fields = readFileSync(`/proc/${pid}/stat`, 'utf8').replace(/^.*\) /, '').split(' '); // from the state on
    return { parent: fields[1]!, seconds: (Number(fields[11]) + Number(fields[12])) / TICKS };
  } catch {
    return undefined;
  }
}
