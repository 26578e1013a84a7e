/** The page of `ico3d studio`, from the consent to the talk, with the quickest training. */
import { join } from 'node:path';
import { onTestFinished, test } from 'vitest';
import { Browser } from '../../support/browser/browser.ts';
import { runPython } from '../../support/python.ts';
import { scratchFolder } from '../../support/scratch.ts';
import { ChatServer } from '../../support/servers/server.ts';
import { Album } from './album.ts';

const TEXTS = ['The quick brown fox jumps over the lazy dog', '0.4', 'while five young boys watch with pleasure', '0.4'];
const PATIENCE = 400_000; // ms of the training

test('studio', async () => {
  const album = new Album();
  const [voice, camera] = [join(scratchFolder(), 'sitter.wav'), join(scratchFolder(), 'sitter.mjpeg')];
  runPython('sound/voice.py', voice, ...TEXTS, ...TEXTS, ...TEXTS, ...TEXTS);
  runPython('references/sitter.py', voice, camera, '640', '480');
  const server = await ChatServer.studio(scratchFolder());
  onTestFinished(() => server.stop());
  const browser = await Browser.launch({ width: 1120, height: 700, microphone: voice, camera });
  const { page } = browser;
  const record = async (part: string, seconds: number, caption: string) => {
    await page.click(`[data-part=${part}]`);
    await page.click('#record');
    await page.waitForTimeout(1000 * seconds);
    await album.shoot(page, caption);
    await page.click('#record');
    await page.waitForSelector(`[data-part=${part}][data-state=kept]`);
  };
  await page.goto(server.url);
  await page.fill('#name', 'Iris');
  await page.check('#agreed');
  await album.shoot(page, 'consent, ticked');
  await page.click('#begin');
  await page.click('#open');
  await page.waitForSelector('#guide[data-word]');
  await record('consent', 5, 'consent, spoken');
  await record('text-1', 9, 'a text');
  await record('left', 4, 'a turn of the head');
  await page.selectOption('#quality', 'quick');
  await page.click('#go');
  await page.waitForSelector('#face:visible', { timeout: PATIENCE });
  await page.waitForTimeout(2000);
  await album.shoot(page, 'the face as it learns');
  await page.waitForSelector('#talk:visible', { timeout: PATIENCE });
  await page.click('#talk');
  await page.waitForFunction(() => document.body.dataset.state === 'idle', undefined, { timeout: 120_000 });
  await page.waitForTimeout(2000); // until nothing of the first screen is seen any more
  await album.shoot(page, 'the talk');
  await browser.close();
  await album.write('page/studio.jpg', 258);
}, 3 * PATIENCE);
