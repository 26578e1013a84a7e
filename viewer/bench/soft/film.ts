/**
 * A film of the screen: a visitor asks, and the avatar answers on a page that draws without WebGL.
 *
 * `FILM=OUT.webp npx vitest run --project bench bench/soft/film.ts`, and `BUNDLE=FILE.ico3d` for
 * somebody else than the packaged person.
 */
import { mkdirSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { expect, test } from 'vitest';
import { Browser } from '../../support/browser/browser.ts';
import { drawnBy } from '../../support/browser/path.ts';
import { REPOSITORY, runPython } from '../../support/python.ts';
import { scratchFolder } from '../../support/scratch.ts';
import { ChatServer } from '../../support/servers/server.ts';

const { FILM, BUNDLE } = process.env;
const DEMO = join(REPOSITORY, 'src/ico3d/chat/data/demo.ico3d');
const [WIDTH, HEIGHT] = [560, 720];
const QUESTION = 'What is ico3d?';
const NEAR = 1500; // ms of the answer in which one sees her lips, before the visitor steps back to see her gestures
const AFTER = 700; // ms that are shown after the answer

test.skipIf(!FILM)('a film of the screen', async () => {
  const server = await ChatServer.start(BUNDLE ?? DEMO);
  const browser = await Browser.launch({ width: WIDTH, height: HEIGHT, hertz: 60 });
  const page = await browser.open(drawnBy('soft', server.url));
  const heard = (speaks: boolean) => page.waitForFunction((wanted) => (window.ico3d!.conversation!.player.heard() !== null) === wanted, speaks, { timeout: 60_000 });
  await heard(true); // the greeting
  await heard(false);

  const pictures: { at: number; data: string }[] = []; // s
  const session = await browser.context.newCDPSession(page);
  session.on('Page.screencastFrame', ({ data, metadata, sessionId }) => {
    pictures.push({ at: metadata.timestamp!, data });
    void session.send('Page.screencastFrameAck', { sessionId });
  });
  await session.send('Page.startScreencast', { format: 'jpeg', quality: 95 });
  await page.locator('#text').pressSequentially(QUESTION, { delay: 60 });
  await page.keyboard.press('Enter');
  await heard(true);
  await page.waitForTimeout(NEAR);
  await page.click('.views [aria-keyshortcuts="3"]');
  await heard(false);
  await page.waitForTimeout(AFTER);
  await session.send('Page.stopScreencast');
  await browser.close();
  await server.stop();

  pictures.sort((a, b) => a.at - b.at); // some overtake each other
  const folder = join(scratchFolder(), 'pictures');
  mkdirSync(folder);
  for (const { at, data } of pictures) writeFileSync(join(folder, `${Math.round(1000 * (at - pictures[0]!.at)).toString().padStart(6, '0')}.jpg`), Buffer.from(data, 'base64'));
  console.log(`${pictures.length} pictures in ${(pictures.at(-1)!.at - pictures[0]!.at).toFixed(1)} s`);
  runPython('film.py', folder, FILM!);
  expect(pictures.length).toBeGreaterThan(10);
});
