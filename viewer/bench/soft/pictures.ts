/** Pictures per second of the packaged person who talks, without WebGL and with software WebGL by turns. */
import { existsSync } from 'node:fs';
import { join } from 'node:path';
import { expect, test } from 'vitest';
import { Browser } from '../../support/browser/browser.ts';
import { REPOSITORY } from '../../support/python.ts';
import { ChatServer } from '../../support/servers/server.ts';

const DEMO = join(REPOSITORY, 'src/ico3d/chat/data/demo.ico3d');
const SIZES = [[900, 700], [390, 844]] as const;
const VIEWS = { '2': 'head and chest', '3': 'whole figure' } as const; // by the key that flies there
const [SETTLING, SECONDS] = [4, 8]; // s
const FASTER = 5; // than software WebGL

test.skipIf(!existsSync(DEMO))('the packaged person, by path', async () => {
  const server = await ChatServer.start(DEMO);
  try {
    for (const [width, height] of SIZES) {
      for (const key of ['2', '3'] as const) {
        const [soft, webgl] = [await rate(server.url, width, height, key, 'soft'), await rate(server.url, width, height, key, 'webgl')];
        console.log(`| ${VIEWS[key]} | ${width} × ${height} | ${soft.toFixed(1)} | ${webgl.toFixed(1)} | ×${(soft / webgl).toFixed(1)} |`);
        expect(soft).toBeGreaterThan(FASTER * webgl);
      }
    }
  } finally {
    await server.stop();
  }
});

/** Pictures/s of the best quality while her face and her body move. */
async function rate(url: string, width: number, height: number, key: string, path: 'soft' | 'webgl'): Promise<number> {
  const browser = await Browser.launch({ width, height, hertz: 60 });
  const page = await browser.open(`${url}?draw=${path}`);
  await page.evaluate(() => {
    let time = 0;
    window.ico3d!.head!.director = {
      expression(out) {
        time += 0.3;
        for (const i of out.keys()) out[i] = 0.3 + 0.3 * Math.sin(time + i);
        return true;
      },
    };
  });
  await page.keyboard.press(key);
  const found = await page.evaluate(
    async ([settling, seconds]) => {
      const wait = (s: number) => new Promise((resolve) => setTimeout(resolve, 1000 * s));
      const { stage } = window.ico3d!;
      await wait(settling!);
      const [frames, begin] = [stage.frames, performance.now()];
      await wait(seconds!);
      return (1000 * (stage.frames - frames)) / (performance.now() - begin);
    },
    [SETTLING, SECONDS],
  );
  await browser.context.close();
  return found;
}
