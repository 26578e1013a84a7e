/** The avatar in the page of another site, and in a headset. */
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { inject, onTestFinished, test } from 'vitest';
import { Browser } from '../../support/browser/browser.ts';
import { drawn, enter, plugIn } from '../../support/browser/headset.ts';
import { REPOSITORY } from '../../support/python.ts';
import { ChatServer } from '../../support/servers/server.ts';
import { Site } from '../../support/servers/site.ts';
import { drawnBy } from '../../support/browser/path.ts';
import { Album } from './album.ts';

const { demo, demoUrl } = inject('shared');
const EXAMPLE = readFileSync(join(REPOSITORY, 'examples/embedding/index.html'), 'utf8');
const BOARD = 'background: conic-gradient(#ddd 25%, #fff 0 50%, #ddd 0 75%, #fff 0) 0 0 / 32px 32px';
const WORDS = `<p style="max-width: 30rem">Trains to the coast leave every hour from platform nine. Bicycles may come
  along outside the rush hour. Seats need not be reserved, but on summer weekends it is a good idea to.</p>`;

test('embedded', async () => {
  const album = new Album();
  let server: ChatServer;
  const avatar = (attributes: string) =>
    EXAMPLE.replace('http://127.0.0.1:8765/', server.url).replace(/<ico3d-avatar.*>/, `${WORDS}<ico3d-avatar ${attributes}></ico3d-avatar>`);
  const kinds: Record<string, [attributes: string, caption: string]> = {
    '/inline': ['draw="soft" autoconnect style="width: 600px; height: 420px"', 'inline'],
    '/floating': ['draw="soft" mode="floating" autoconnect', 'floating'],
    '/transparent': [`draw="soft" transparent autoconnect style="width: 600px; height: 420px; ${BOARD}"`, 'transparent, over a checkerboard'],
  };
  const site = await Site.open((path) => (kinds[path] ? avatar(kinds[path][0]) : ''));
  onTestFinished(() => site.close());
  server = await ChatServer.start(demo!, 0, '--allow-origin', site.origin);
  onTestFinished(() => server.stop());
  for (const [path, [, caption]] of Object.entries(kinds)) {
    const browser = await Browser.launch({ width: 660, height: 640, calm: true });
    const { page } = browser;
    await page.goto(site.origin + path);
    for (const state of ['speaking', 'idle']) await page.locator(`ico3d-avatar [data-state=${state}]`).waitFor({ timeout: 60_000 });
    await album.shoot(page, caption);
    await browser.close();
  }
  await album.write('page/embedded.jpg', 395);
});

test('in a headset', async () => {
  const browser = await Browser.launch({ width: 1000, height: 520 });
  const { page } = browser;
  await plugIn(page);
  await browser.open(drawnBy('webgl', demoUrl!));
  await page.waitForFunction(() => document.body.dataset.state === 'idle', undefined, { timeout: 60_000 });
  await enter(page, 'Enter VR');
  await page.evaluate(() => {
    window.headset.position.z -= 0.5; // a step towards her
    const [left, right] = Object.values(window.headset.controllers);
    left!.position.set(0.05, 1.1, -0.75);
    right!.position.set(0.55, 1.1, -0.75);
  });
  await drawn(page, 4);
  const png = await page.evaluate(() => document.querySelector<HTMLCanvasElement>('#stage')!.toDataURL().split(',')[1]!);
  const album = new Album();
  album.add(Buffer.from(png, 'base64'), 'Both eyes of an emulated headset');
  await album.write('headset/both-eyes.jpg', 520);
  await browser.close();
});
