import { writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { afterAll, beforeAll, expect, inject, test } from 'vitest';
import { Browser } from '../support/browser/browser.ts';
import { drawSeldom } from '../support/browser/drawing.ts';
import { drawnBy } from '../support/browser/path.ts';
import { runPython } from '../support/python.ts';
import { scratchFolder } from '../support/scratch.ts';
import { ChatServer } from '../support/servers/server.ts';

const folder = scratchFolder();
const voice = join(folder, 'voice.wav');
let server: ChatServer;

beforeAll(async () => {
  runPython('sound/voice.py', voice, '1', ...Array.from({ length: 8 }, () => ['What is your name?', '4']).flat());
  writeFileSync(join(folder, 'chat.toml'), 'recognition = "browser"\n');
  server = await ChatServer.start(inject('shared').talking, 0, '--settings', join(folder, 'chat.toml'));
});

afterAll(() => server?.stop());

/** A page with an open microphone whose browser runs a script first. */
async function talk(script: () => void): Promise<Browser> {
  const browser = await Browser.launch({ microphone: voice });
  await browser.context.addInitScript(script);
  const page = await browser.open(drawnBy('soft', server.url));
  await drawSeldom(page);
  await page.waitForFunction(
    () => document.getElementById('answer')!.textContent === 'Hello.' && document.body.dataset.state === 'idle',
  ); // the greeting is over
  await page.click('#microphone');
  return browser;
}

test('what the browser understood is answered, and the page says who hears it', async () => {
  const browser = await talk(() => {
    class Recogniser {
      onresult?: (event: object) => void;
      onend?: () => void;
      start(track: MediaStreamTrack): void {
        const says = (transcript: string, isFinal: boolean) =>
          this.onresult!({ resultIndex: 0, results: [Object.assign([{ transcript }], { isFinal })] });
        const timer = setInterval(() => {
          if (document.body.dataset.state !== 'listening' || track.readyState !== 'live') return;
          clearInterval(timer);
          says('who', false);
          says('Who are you?', true);
        }, 20);
      }
      stop(): void {
        this.onend!();
      }
    }
    Object.assign(window, { SpeechRecognition: Recogniser });
  });
  const { page } = browser;
  await page.waitForFunction(() => document.getElementById('answer')!.textContent === 'I am Stella.');
  expect(await page.textContent('#question')).toBe('Who are you?');
  expect(await page.isVisible('#shared-voice')).toBe(true);
  await browser.close();
});

test('a browser without a recogniser leaves it to the server, and says so', async () => {
  const browser = await talk(() => {
    Object.assign(window, { SpeechRecognition: undefined, webkitSpeechRecognition: undefined });
  });
  const { page } = browser;
  expect(await page.locator('#notices p').first().textContent()).toBe(
    'This browser does not recognise speech; pocketsphinx on the server listens instead.',
  );
  await page.waitForFunction(() => document.getElementById('question')!.textContent !== '');
  expect(await page.isVisible('#shared-voice')).toBe(false);
  await browser.close();
});
