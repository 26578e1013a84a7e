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
const reached = (id: string, state: string) => browser.page.waitForSelector(`[data-part=${id}][data-state=${state}]`);
/** Whether an element is in the part of the page that the window shows, wholly. */
const isSeen = (selector: string) =>
  browser.page.$eval(selector, (element) => {
    const { top, bottom } = element.getBoundingClientRect();
    return top >= 0 && bottom <= innerHeight;
  });
const filesOf = (id: string) => (existsSync(parts) ? readdirSync(parts).filter((name) => name.startsWith(`${id}.`)).toSorted() : []);

/** What the server has of parts that are being recorded, or were not finished. */
const pieces = () => readdirSync(folder, { recursive: true, encoding: 'utf8' }).filter((name) => name.endsWith('.part'));

/** Records the chosen part for some seconds, and until the server has some of it. */
async function record(seconds = 1): Promise<void> {
  await browser.page.click('#record');
  const isLong = (least: number) => Number(/(\d+) s/.exec(document.querySelector('#clock')!.textContent!)?.[1] ?? 0) >= least;
  await browser.page.waitForFunction(isLong, seconds);
  await expect.poll(() => pieces().length).toBeGreaterThan(0);
}

/** How full the meter of a row is: 0 for time, 1 for texts. */
const meterOf = (row: number) => browser.page.$$eval('#meters > dd > meter', (meters, n) => (meters[n] as HTMLMeterElement).value, row);

test.skipIf(!demo)('consent, parts, a retake, a closed page, and everything deleted', async () => {
  const page = await open();
  await page.waitForSelector('#start:visible');
  expect(await page.isVisible('#voice-tick')).toBe(false); // nobody is asked here
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

  expect(await page.textContent('#guide')).toBe('The camera is off');
  expect(await page.textContent('#first')).toMatch(/^Record your consent/);
  await page.click('#open');
  await page.waitForSelector('#guide[data-word]');
  await record();
  await page.click('#record');
  await reached('consent', 'kept');
  expect(filesOf('consent')).toEqual(['consent.json', 'consent.webm']);
  expect(readFileSync(join(folder, 'Ida', 'consent.json'), 'utf8')).toContain('ticked and spoken');

  await page.click('[data-part=text-1]');
  expect([await meterOf(0), await meterOf(1)]).toEqual([0, 0]);
  await record();
  expect(await meterOf(0)).toBeGreaterThan(0); // they move while somebody reads
  expect(await meterOf(1)).toBeGreaterThan(0);
  await page.click('#record');
  await reached('text-1', 'kept');
  const first = statSync(join(parts, 'text-1.webm')).mtimeMs;
  expect(await page.textContent('#meters')).toContain('1 of 6');
  expect(await page.textContent('#sounds')).toMatch(/^Read the texts aloud, .* all 45 speech sounds of the language\. \d+ of them are recorded\.$/);
  await page.selectOption('#language', 'de');
  expect(await page.textContent('#clock')).toBe(''); // nothing of what is over comes back in another language
  await page.selectOption('#language', 'en');
  expect(await page.isDisabled('#go')).toBe(false);
  expect(await page.textContent('#first')).toBe('It can be made now; more parts make it better.');
  await page.click('[data-part=text-1]');
  await page.click('#play');
  await page.waitForFunction(() => document.querySelector<HTMLVideoElement>('#replay')!.videoWidth > 0);
  await page.click('#close');
  await record(5); // a retake, long enough to pass for a whole video
  expect(statSync(join(parts, 'text-1.webm')).mtimeMs).toBe(first);
  let look = () => {};
  const looked = new Promise<void>((resolve) => (look = resolve));
  await page.route('**/keep', async (route) => {
    await looked;
    await route.continue();
  });
  await page.click('#record');
  await expect.poll(() => page.textContent('#clock')).toBe('Saving …');
  for (const button of ['#record', '#remove', '#upload', '#go']) expect(await page.isDisabled(button), button).toBe(true);
  await page.click('[data-part=text-2]');
  expect(await page.getAttribute('[data-part=text-1]', 'aria-pressed')).toBe('true'); // nothing else begins meanwhile
  look();
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
  await again.locator('#delete').scrollIntoViewIfNeeded(); // as somebody who has pressed a button down there
  await again.setInputFiles('#file', join(folder, 'notes.txt'));
  await again.waitForSelector('#problem:visible');
  expect(await again.textContent('#problem')).toMatch(/^This is no video that can be read/);
  expect(await isSeen('#problem')).toBe(true);
  expect(await stateOf('text-1')).toBe('kept');
  await again.setInputFiles('#file', join(parts, 'text-1.webm'));
  await reached('upload', 'kept');
  await again.waitForSelector('[data-part=upload][aria-pressed=true]'); // with what is wrong with it
  expect(await again.textContent('#task')).toBe('The avatar is made of this video alone. Delete it to use the parts instead.');
  expect(await again.isVisible('#view')).toBe(false);
  expect(await again.isVisible('#meters')).toBe(false);
  await expect.poll(() => isSeen('#task')).toBe(true);
  await again.click('#back');
  await again.click('#people button');
  await again.waitForSelector('[data-part=upload][aria-pressed=true]'); // nothing else is asked for
  await again.click('#remove');
  await again.waitForSelector('[data-part=text-2][aria-pressed=true]');
  expect(await again.isVisible('#open')).toBe(true);
  expect(await again.isVisible('#meters')).toBe(true);
  expect(await again.textContent('#delete')).toBe('Delete everything of Ida');

  await again.click('#delete');
  await again.waitForSelector('#start:visible');
  await again.waitForSelector('#problem.told');
  expect(await again.textContent('#problem')).toBe('Everything of Ida is gone.');
  expect(readdirSync(folder)).toEqual(['.studio.lock', 'notes.txt']); // the lock is nobody's
  await again.goBack(); // to an address of hers
  await again.waitForSelector('#problem.told');
  expect(await again.textContent('#problem')).toBe('Everything of Ida is gone.');
});

test.skipIf(!demo)('who leaves while it records, and who was deleted in another tab', async () => {
  const page = await open();
  await page.fill('#name', 'Eva');
  await page.check('#agreed');
  await page.click('#begin');
  await page.click('#open');
  await record();
  await page.click('#back');
  await page.click('#people button');
  await reached('consent', 'broken'); // what was sent can be kept
  expect(await page.isVisible('#open')).toBe(true);
  expect(await page.isVisible('#salvage')).toBe(true);

  let clicked = () => {};
  const held = new Promise<void>((resolve) => (clicked = resolve));
  await page.route(({ pathname }) => pathname.endsWith('/recordings/Eva'), async (route) => {
    await held; // else it looks now and then, and knows before somebody clicks
    await route.continue();
  });
  const other = await browser.context.newPage();
  other.on('dialog', (dialog) => void dialog.accept());
  await other.goto(server.url);
  await other.click('#people button');
  await other.click('#delete');
  await other.waitForSelector('#start:visible');
  await other.fill('#name', 'Ola');
  await other.check('#agreed');
  await other.click('#begin');
  await other.waitForSelector('#room:visible');
  await other.close();
  await page.click('#salvage');
  clicked();
  await page.waitForSelector('#start:visible');
  await expect.poll(() => page.textContent('#problem')).toMatch(/^Eva was deleted elsewhere, .* begin a new recording here\.$/);
  await page.click('#people button');
  await page.waitForSelector('#room:visible');
  expect(await page.textContent('#title')).toBe('Ola');
  expect(await page.isVisible('#problem')).toBe(false); // that was of somebody else
});

test.skipIf(!demo)('a disk that fills up while it records is told, and what has arrived can be kept', async () => {
  const page = await open();
  await page.fill('#name', 'Ina');
  await page.check('#agreed');
  await page.click('#begin');
  await page.click('#open');
  server.limit(150_000);
  try {
    await page.click('#record');
    await page.waitForSelector('#problem:visible');
  } finally {
    server.limit('unlimited');
  }
  expect(await page.textContent('#problem')).toMatch(/^The disk is full: free some space and go on\. What was recorded is kept\.$/);
  await reached('consent', 'broken');
  const [part] = readdirSync(join(folder, 'Ina', 'parts'));
  expect(statSync(join(folder, 'Ina', 'parts', part!)).size).toBeGreaterThan(10_000);
  await page.click('#salvage');
  await reached('consent', 'kept');
  expect(await page.isEnabled('[data-part=text-1]')).toBe(true);
});

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
});
