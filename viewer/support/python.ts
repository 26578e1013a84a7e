import { execFileSync, spawn, type ChildProcessByStdio } from 'node:child_process';
import { once } from 'node:events';
import { existsSync } from 'node:fs';
import type { Readable } from 'node:stream';
import { fileURLToPath } from 'node:url';

export const REPOSITORY = fileURLToPath(new URL('../../', import.meta.url));

/** The Python that has ico3d: $ICO3D_PYTHON, or the checkout's own. */
export const PYTHON = process.env.ICO3D_PYTHON ?? `${REPOSITORY}.venv/bin/python`;

const FORKS = `${REPOSITORY}viewer/support/forks.py`;

if (!existsSync(PYTHON)) throw new Error(`no Python at ${PYTHON}: run make install or set ICO3D_PYTHON`);

/**
 * One thread for each: tests run side by side, and what they compute is small.
 * This checkout and what its tests share come before what is installed.
 */
export const ENVIRONMENT = {
  ...process.env,
  OMP_NUM_THREADS: '1',
  OPENBLAS_NUM_THREADS: '1',
  NUMBA_NUM_THREADS: '1',
  PYTHONPATH: `${REPOSITORY}src:${REPOSITORY}tests`,
};

/** Runs forks (`forks.py`) at an address until the function that it gives is called, or this process ends. */
export async function startForks(address: string): Promise<() => void> {
  const forks = spawn(PYTHON, [FORKS, address], { cwd: REPOSITORY, env: ENVIRONMENT, stdio: ['pipe', 'pipe', 'inherit'] });
  await once(forks.stdout, 'data'); // it is ready
  process.env.ICO3D_FORKS = address; // workers inherit it
  return () => forks.stdin.end();
}

/** What Python is asked that asks for a fork. */
const forked = (...words: string[]) => ['-I', '-S', FORKS, process.env.ICO3D_FORKS!, ...words];

/** Runs a script of `support/` that imports torch to its end, in a fork of a process that has imported it. */
export function runFork(script: string, ...args: string[]): void {
  execFileSync(PYTHON, forked(`${REPOSITORY}viewer/support/${script}`, ...args), { stdio: ['ignore', 'ignore', 'inherit'] });
}

/** Starts `ico3d serve` in a fork of a process that has imported what it needs; it ends by SIGINT, or at once by SIGUSR1. */
export function forkServer(...args: string[]): ChildProcessByStdio<null, Readable, null> {
  return spawn(PYTHON, forked('serve', ...args), { stdio: ['ignore', 'pipe', 'inherit'] });
}

/** Runs a script as Python does, without looking for garbage: what is imported, which takes longest, stays. */
const WITHOUT_COLLECTING = `import gc, os, runpy, sys
gc.disable()
sys.argv = sys.argv[1:]
sys.path[0] = os.path.dirname(sys.argv[0])
runpy.run_path(sys.argv[0], run_name="__main__")`;

/** Runs a script of `support/` to its end; what it printed. */
export function runPython(script: string, ...args: string[]): string {
  const path = `${REPOSITORY}viewer/support/${script}`;
  const stdio = ['ignore', 'pipe', 'inherit'] as const;
  return execFileSync(PYTHON, ['-c', WITHOUT_COLLECTING, path, ...args], { cwd: REPOSITORY, env: ENVIRONMENT, stdio: [...stdio], encoding: 'utf8' });
}
