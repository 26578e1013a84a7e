import type { MakePainter, Path } from '../soft/contract.ts';

/** What makes a path's painters, fetched where that path draws and nowhere else. */
export const PAINTERS: Readonly<Record<Path, () => Promise<MakePainter>>> = {
  webgl: async () => (await import('./webgl.ts')).makeSparkPainter,
  soft: async () => (await import('../soft/painter.ts')).makeSoftPainter,
};
