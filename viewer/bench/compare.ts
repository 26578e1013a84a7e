import { createServer } from 'vite';
import { Browser } from '../support/browser/browser.ts';
import { drawnBy } from '../support/browser/path.ts';
import { lookAsBundled, psnr, takePixels } from '../support/browser/pictures.ts';
import { processorTime } from '../support/processor.ts';
import { REPOSITORY } from '../support/python.ts';
import { servePage } from '../support/servers/static.ts';
import { quantile } from '../support/statistics.ts';
import type { Frame } from './page/drawing.ts';

const [WIDTH, HEIGHT] = [240, 320];
const BLOCKS = 5; // of either scene, in turns: a busy machine slows both
const FRAMES = 24; // in a block
const SCENES = ['still', 'animated'] as const;
/** Likeness of scenes that show one moment, dB; splats at rest keep their centres to half a millimetre. */
export const SAME = 40;
type Scene = (typeof SCENES)[number];

/** Two scenes beside each other. */
export interface Comparison {
  animated: Frame[];
  still: Frame[];
  likeness: number; // dB, of a picture of each, before the animated one moves
  cost: number; // frame time of the animated one, in that of the still one; medians
}

/**
 * Draws an animated scene and a still one in turns, and says what they took.
 *
 * @param folder the bundle's files
 * @param script in `page/`, which sets `window.scenes`
 */
export async function compare(folder: string, script: string): Promise<Comparison> {
  const files = await servePage(folder); // without a conversation
  const proxy = { '/bundle': files.url, '/ws': files.url };
  const pages = await createServer({ root: `${REPOSITORY}viewer`, logLevel: 'error', server: { port: 0, host: '127.0.0.1', proxy } });
  await pages.listen();
  const browser = await Browser.launch({ width: WIDTH, height: HEIGHT });
  const { page } = browser;
  await browser.open(drawnBy('webgl', pages.resolvedUrls!.local[0]!));
  await lookAsBundled(page, folder);
  await page.evaluate(() => window.ico3d!.stage.still());
  await page.addScriptTag({ type: 'module', url: `/bench/page/${script}` });
  await page.waitForFunction(() => window.scenes !== undefined, undefined, { timeout: 120_000 });
  const looks = [];
  for (const scene of SCENES) {
    await page.evaluate((name) => window.scenes![name](1), scene);
    looks.push(await takePixels(page));
  }
  const likeness = psnr(looks[0]!, looks[1]!);
  const frames: Record<Scene, Frame[]> = { animated: [], still: [] };
  const used: Record<Scene, number> = { animated: 0, still: 0 };
  for (let turn = 0; turn < 2 * BLOCKS; turn++) {
    const scene = SCENES[turn % 2]!;
    const before = processorTime();
    frames[scene].push(...(await page.evaluate(([name, count]) => window.scenes![name](count), [scene, FRAMES] as const)));
    used[scene] += processorTime() - before;
  }
  await browser.close();
  await pages.close();
  files.close();
  const [moving, standing] = SCENES.toReversed().map((scene) => quantile(frames[scene].map(({ ms }) => ms), 0.5));
  const cost = moving! / standing!;
  console.log(
    `frame time animated / still: ×${cost.toFixed(2)}, median ${moving!.toFixed(0)} and ${standing!.toFixed(0)} ms; ` +
      `processor time, with what fetches, unpacks and sorts beside: ×${(used.animated / used.still).toFixed(2)}; ` +
      `scenes alike by ${likeness.toFixed(1)} dB`,
  );
  return { ...frames, likeness, cost };
}
