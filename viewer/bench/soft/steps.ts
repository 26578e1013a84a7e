/** What each step of drawing without WebGL takes, in one thread, by size and number of Gaussians. */
import { existsSync } from 'node:fs';
import { join } from 'node:path';
import { expect, test } from 'vitest';
import { makeKernel } from '../../src/soft/kernel.ts';
import { Rasteriser } from '../../src/soft/rasteriser.ts';
import { TILE_WIDTH } from '../../src/soft/tiles.ts';
import { REPOSITORY } from '../../support/python.ts';
import { clothOf } from '../../support/browser/view.ts';
import { makeGaussians } from '../../support/references/gaussians/reference.ts';
import { quantile } from '../../support/statistics.ts';

const DEMO = join(REPOSITORY, 'src/ico3d/chat/data/demo.ico3d');
const SIZES = [[256, 256], [900, 700]] as const;
const PICTURES = 30;
const MOST = 200; // ms of any picture, on a busy machine

test('steps of a picture', async () => {
  const scenes = [{ gaussians: 10_000 }, { gaussians: 20_000 }, ...(existsSync(DEMO) ? [{ bundle: DEMO }] : [])];
  for (const scene of scenes) {
    for (const [width, height] of SIZES) {
      const { source, view, lens } = makeGaussians({ ...scene, size: `${width}x${height}` });
      const kernel = await makeKernel();
      const times = { project: [] as number[], spread: [] as number[], bin: [] as number[], draw: [] as number[] };
      const timed = { ...kernel, begin: time(kernel.begin, times.project), addStill: time(kernel.addStill, times.project, true), spread: time(kernel.spread, times.spread), bin: time(kernel.bin, times.bin), draw: time(kernel.draw, times.draw) };
      const rasteriser = new Rasteriser(timed);
      rasteriser.put(0, source);
      const columns = Math.ceil(width / TILE_WIDTH);
      const cloth = clothOf([0.5, 0.5, 0.5], width, height);
      const placed = [{ id: 0, view, drawn: source.count, values: new Float32Array(0) }];
      for (let i = 0; i < PICTURES; i++) {
        rasteriser.forget(); // no tile keeps its pixels
        rasteriser.draw({ lens, width, height, band: [0, columns], placed }, cloth);
      }
      const [project, spread, bin, draw] = [times.project, times.spread, times.bin, times.draw].map((list) => quantile(list, 0.5));
      const all = project! + spread! + bin! + draw!;
      const name = 'bundle' in scene ? 'packaged person' : 'random';
      console.log(`| ${source.count} (${name}) | ${width} × ${height} | ${project!.toFixed(1)} | ${spread!.toFixed(1)} | ${bin!.toFixed(1)} | ${draw!.toFixed(1)} | ${all.toFixed(1)} |`);
      expect(all).toBeLessThan(MOST);
    }
  }
});

/** A function that adds what it took to a list, or to the list's last number, ms. */
function time<T extends unknown[], R>(run: (...given: T) => R, list: number[], further = false): (...given: T) => R {
  return (...given) => {
    const before = performance.now();
    const result = run(...given);
    const took = performance.now() - before;
    if (further) list[list.length - 1]! += took;
    else list.push(took);
    return result;
  };
}
