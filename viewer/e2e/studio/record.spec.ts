import { existsSync, readdirSync, readFileSync, statSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { afterAll, afterEach, beforeAll, expect, inject, test } from 'vitest';
import { judge } from '../../support/browser/axe.ts';
import { Browser } from '../../support/browser/browser.ts';
import { runFork, runPython } from '../../support/python.ts';
import { scratchFolder } from '../../support/scratch.ts';
import { ChatServer } from '../../support/servers/server.ts';

const folder = scratchFolder();
const parts = join(folder, 'Ida', 'parts');
const voice = join(scratchFolder(), 'sitter.wav');
const camera = join(scratchFolder(), 'sitter.mjpeg');
const { demo } = inject('shared');
let server: ChatServer;
let browser: Browser;

beforeAll(async () => {
  if (!demo) return;
  runPython('sound/voice.py', voice, 'I agree');
  runFork('references/sitter.py', voice, camera);
  runPython('sound/voice.py', voice, ...Array<string>(8).fill('I agree that an avatar is made of this recording'));
  server = await ChatServer.studio(folder);
});
afterEach(() => browser.close());
afterAll(() => server?.stop());

/** Opens the page with a camera that shows a synthetic person who talks. */
async function open(width = 1280, height = 800): Promise<Browser['page']> {
  browser = await Browser.launch({ width, height, microphone: voice, camera });
  await browser.page.goto(server.url);
  return browser.page;
}

const stateOf = (id: string) => browser.page.getAttribute(`[data-part=${id}]`, 'data-state');
const reached = (id: string, state: string) => browser.page.waitForSelector(`[data-part=${id}][data-state=${state}]`, { timeout: 30_000 });
const filesOf = (id: string) => (existsSync(parts) ? readdirSync(parts).filter((name) => name.startsWith(`${id}.`)).toSorted() : []);

/** Records the chosen part until the server has some of it. */
async function record(): Promise<void> {
  await browser.page.click('#record');
  await browser.page.waitForFunction(() => /[1-9] s/.test(document.querySelector('#clock')!.textContent!), undefined, { timeout: 30_000 });
}

test.skipIf(!demo)('consent, parts, a retake, a closed page, and everything deleted', async () => {
  const page = await open();
  await page.waitForSelector('#start:visible');
  await page.fill('#name', 'Ida');
  await page.click('#begin');
  expect(existsSync(join(folder, 'Ida'))).toBe(false); // not ticked yet
  await page.check('#agreed');
  await page.click('#begin');
  await page.waitForSelector('#room:visible');
  const consent = JSON.parse(readFileSync(join(folder, 'Ida', 'consent.json'), 'utf8')) as Record<string, string>;
  expect(consent).toMatchObject({ likeness: 'Ida', kind: 'portrait', consent: expect.stringContaining('ticked: “I am Ida. I agree') });
  expect(await page.textContent('#text')).toBe('I am Ida. I agree that a talking avatar with my face is made from this recording.');
  expect(await page.isDisabled('#go')).toBe(true);

  await page.click('#open');
  await page.waitForFunction(() => document.querySelector('#guide')!.textContent !== '', undefined, { timeout: 30_000 });
  await record();
  await page.click('#record');
  await reached('consent', 'kept');
  expect(filesOf('consent')).toEqual(['consent.json', 'consent.webm']);
  expect(readFileSync(join(folder, 'Ida', 'consent.json'), 'utf8')).toContain('ticked and spoken');

  await page.click('[data-part=text-1]');
  await record();
  await page.click('#record');
  await reached('text-1', 'kept');
  const first = statSync(join(parts, 'text-1.webm')).mtimeMs;
  expect(await page.textContent('#meters')).toContain('of 45');
  expect(await page.isDisabled('#go')).toBe(false);
  await page.click('[data-part=text-1]');
  await page.click('#play');
  await page.waitForFunction(() => document.querySelector<HTMLVideoElement>('#replay')!.videoWidth > 0);
  await page.click('#close');
  await record(); // a retake
  expect(statSync(join(parts, 'text-1.webm')).mtimeMs).toBe(first);
  await page.click('#record');
  await expect.poll(() => statSync(join(parts, 'text-1.webm')).mtimeMs).toBeGreaterThan(first);
  await expect.poll(() => filesOf('text-1')).toEqual(['text-1.json', 'text-1.webm']);
  await page.waitForSelector('#play:visible');
  await judge(page, 'studio');

  await page.click('[data-part=left]');
  await record();
  await browser.close(); // midway
  expect(filesOf('left')).toEqual([expect.stringMatching(/^left\.\w+\.part$/)]);

  const again = await open(390, 844);
  again.on('dialog', (dialog) => void dialog.accept());
  await again.click('#people button');
  await reached('left', 'broken');
  await again.click('[data-part=left]');
  await again.click('#salvage');
  await reached('left', 'kept');
  expect(filesOf('left')).toEqual(['left.json', 'left.webm']);
  await again.click('#remove');
  await reached('left', 'missing');
  expect(filesOf('left')).toEqual([]);
  expect(await again.evaluate(() => document.documentElement.scrollWidth - document.documentElement.clientWidth)).toBeLessThanOrEqual(0);

  writeFileSync(join(folder, 'notes.txt'), 'no video');
  await again.setInputFiles('#file', join(folder, 'notes.txt'));
  await again.waitForSelector('#problem:visible');
  expect(await again.textContent('#problem')).toMatch(/^This is no video that can be read/);
  expect(await stateOf('text-1')).toBe('kept');
  await again.setInputFiles('#file', join(parts, 'text-1.webm'));
  await reached('upload', 'kept');

  await again.click('#delete');
  await again.waitForSelector('#start:visible');
  expect(await again.textContent('#problem')).toBe('Everything of Ida is gone.');
  expect(readdirSync(folder)).toEqual(['notes.txt']);
}, 120_000);

test.skipIf(!demo)('a voice is agreed to by a tick of its own, off at first, in the language of the page', async () => {
  const page = await open();
  await page.waitForSelector('#start:visible');
  expect(await page.isVisible('#voice-tick')).toBe(false); // nobody is asked here
  await browser.close();
  const own = join(scratchFolder(), 'voices');
  const asking = await ChatServer.studio(own, 0, '--voice');
  try {
    browser = await Browser.launch({ width: 390, height: 844 });
    const { page } = browser;
    await page.goto(asking.url);
    await page.waitForSelector('#voice-tick:visible');
    expect(await page.isChecked('#voice')).toBe(false);
    await judge(page, 'studio voice');
    await page.selectOption('#language', 'de');
    await expect.poll(() => page.textContent('#voice-sentence')).toMatch(/^Ich bin auch einverstanden, .* meiner Stimme/);
    for (const [name, ticks] of [['Ida', ['#agreed', '#voice']], ['Ada', ['#agreed']]] as const) {
      await page.fill('#name', name);
      for (const tick of ticks) await page.check(tick);
      await page.click('#begin');
      await page.waitForSelector('#room:visible');
      const consent = JSON.parse(readFileSync(join(own, name, 'consent.json'), 'utf8')) as Record<string, string>;
      expect('voice_consent' in consent).toBe(name === 'Ida');
      expect((await page.textContent('#text'))!.includes('Stimme')).toBe(name === 'Ida');
      await page.click('#back');
      await page.waitForSelector('#start:visible');
    }
  } finally {
    await asking.stop();
  }
}, 60_000);

test.skipIf(!demo)('a camera that is not given, and a server that is gone, are told', async () => {
  browser = await Browser.launch({ width: 390, height: 844 });
  const { page } = browser;
  await page.addInitScript(() => {
    navigator.mediaDevices.getUserMedia = () => Promise.reject(new DOMException('refused', 'NotAllowedError'));
  });
  await page.goto(server.url);
  await page.fill('#name', 'Ada');
  await page.check('#agreed');
  await page.click('#begin');
  await page.click('#open');
  await page.waitForSelector('#problem:visible');
  expect(await page.textContent('#problem')).toMatch(/^Camera or microphone are blocked/);
  await page.route('**/recordings/**', (route) => route.abort());
  await page.click('#back');
  await expect.poll(() => page.textContent('#problem')).toMatch(/^The server does not answer/);
}, 60_000);
