/** A visit from the first moment on, and what may interrupt it. */
import { writeFileSync } from 'node:fs';
import { join } from 'node:path';
import type { Page } from 'playwright-core';
import { inject, test } from 'vitest';
import { Browser } from '../../support/browser/browser.ts';
import { scratchFolder } from '../../support/scratch.ts';
import { ChatServer } from '../../support/servers/server.ts';
import { SlowLine } from '../../support/servers/slow.ts';
import { keepSound, makeVoice } from '../../support/browser/talk.ts';
import { drawnBy } from '../../support/browser/path.ts';
import { Album } from './album.ts';
import { arrive, ask, greeted, Line, silent } from './visitor.ts';

const SIZE = { width: 800, height: 520 };
const MEGABIT = 1e6; // bit/s
const { demo, demoUrl } = inject('shared');

/** Waits until the overlay says a sentence. */
const says = (page: Page, words: RegExp) =>
  page.waitForFunction((words) => new RegExp(words).test(document.querySelector('#overlay-error')!.textContent!), words.source, { timeout: 60_000 });

test('a talk', async () => {
  const album = new Album();
  await coming(album);
  await talking(album);
  await album.write('page/talk.jpg', 262);
});

/** Loading, and the button that lets sound play. */
async function coming(album: Album): Promise<void> {
  const browser = await Browser.launch({ ...SIZE, calm: true });
  const { page } = browser;
  await page.emulateMedia({ colorScheme: 'dark', reducedMotion: 'reduce' });
  await keepSound(page);
  const line = await SlowLine.to(demoUrl!, 3 * MEGABIT, 40);
  await page.goto(drawnBy('soft', line.url));
  await page.waitForFunction(() => document.querySelector<HTMLProgressElement>('#progress')!.value > 0.4);
  await album.shoot(page, 'Loading, in words');
  await page.waitForSelector('#choices:visible', { timeout: 60_000 });
  await album.shoot(page, 'Browsers play sound after a click only');
  await browser.close();
  line.close();
}

/** Ready, listening, thinking, speaking, interrupted. */
async function talking(album: Album): Promise<void> {
  const voice = join(scratchFolder(), 'voice.wav');
  makeVoice(voice);
  const listening = await Browser.launch({ ...SIZE, calm: true, microphone: voice });
  const line = await Line.through(listening.page, /"state": ?"thinking"/);
  const { page } = listening;
  await page.emulateMedia({ colorScheme: 'dark', reducedMotion: 'reduce' });
  await listening.open(drawnBy('soft', demoUrl!));
  await greeted(page);
  await album.shoot(page, 'Ready');
  await page.click('#microphone');
  const hears = () =>
    document.body.dataset.state === 'listening' && document.querySelector('#question.partial')?.textContent && !document.querySelector('#notices p');
  await page.waitForFunction(hears, undefined, { timeout: 60_000 });
  await album.shoot(page, 'Listening: what is understood so far');
  line.hold();
  await page.waitForFunction(() => document.body.dataset.state === 'thinking', undefined, { timeout: 30_000 });
  await album.shoot(page, 'Thinking');
  await listening.close();

  const speaking = await arrive(demoUrl!, SIZE);
  await ask(speaking.page);
  await album.shoot(speaking.page, 'Speaking: captions word by word');
  await speaking.page.click('#stop');
  await silent(speaking.page);
  await album.shoot(speaking.page, 'Interrupted: what was not said goes');
  await speaking.close();
}

test('what interrupts a talk', async () => {
  const album = new Album();
  await noPlace(album);
  await refused(album);
  await noLine(album);
  await noPicture(album);
  await album.write('page/stumbles.jpg', 262);
}, 200_000);

/** A full house, and somebody who fell silent. */
async function noPlace(album: Album): Promise<void> {
  const settings = join(scratchFolder(), 'full.toml');
  writeFileSync(settings, 'max_sessions = 1\nidle_minutes = 0.3\n');
  const server = await ChatServer.start(demo!, 0, '--settings', settings);
  const first = await arrive(server.url, SIZE);
  const second = await arrive(server.url, { ...SIZE, typing: false });
  await says(second.page, /next/);
  await album.shoot(second.page, 'All places are taken');
  await second.close();
  await says(first.page, /^Nothing was said/);
  await album.shoot(first.page, 'Nobody spoke for a while');
  await first.close();
  await server.stop();
}

async function refused(album: Album): Promise<void> {
  const browser = await arrive(demoUrl!, SIZE);
  const { page } = browser;
  await page.evaluate(() => {
    navigator.mediaDevices.getUserMedia = () => Promise.reject(new DOMException('refused', 'NotAllowedError'));
  });
  await page.click('#microphone');
  await page.waitForSelector('#notices p');
  await album.shoot(page, 'The microphone is blocked');
  await browser.close();
}

async function noLine(album: Album): Promise<void> {
  const browser = await Browser.launch({ ...SIZE, calm: true });
  const { page } = browser;
  const line = await Line.through(page);
  await page.emulateMedia({ colorScheme: 'dark', reducedMotion: 'reduce' });
  await browser.open(drawnBy('soft', demoUrl!));
  await greeted(page);
  await line.cut();
  await page.waitForFunction(() => document.body.dataset.state === 'connecting');
  await album.shoot(page, 'The connection is lost, and opened again');
  await says(page, /server/);
  await album.shoot(page, 'It does not come back within half a minute');
  await browser.close();
}

async function noPicture(album: Album): Promise<void> {
  const browser = await arrive(demoUrl!, { ...SIZE, draw: 'webgl' });
  const { page } = browser;
  await page.evaluate(() => window.ico3d!.stage.renderer.getContext().getExtension('WEBGL_lose_context')!.loseContext());
  await page.waitForFunction(() => window.ico3d!.stage.painter.path === 'soft' && window.ico3d!.stage.figures.gaussians > 0);
  await page.click('#panel-button');
  await page.waitForFunction(() => document.querySelector('#panel')!.textContent!.includes('the processor'));
  await album.shoot(page, 'The browser took WebGL away for good: the processor draws');
  await browser.close();
}
