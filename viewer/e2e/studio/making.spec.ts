import { copyFileSync, cpSync, existsSync, mkdirSync, readdirSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { afterAll, afterEach, beforeAll, beforeEach, expect, inject, test } from 'vitest';
import { judge } from '../../support/browser/axe.ts';
import { Browser } from '../../support/browser/browser.ts';
import { runPython } from '../../support/python.ts';
import { hasTracker, MODELS } from '../../support/references/portrait.ts';
import { scratchFolder } from '../../support/scratch.ts';
import { ChatServer } from '../../support/servers/server.ts';

const folder = scratchFolder();
const person = join(folder, 'Ida');
const recorded = scratchFolder();
const grey = join(recorded, 'grey.mp4');
const { demo } = inject('shared');
let server: ChatServer;
let browser: Browser;
let page: Browser['page'];

beforeAll(async () => {
  runPython('studio/recorded.py', recorded, 'Ida', grey);
  server = await ChatServer.tracking(folder, MODELS, '--voice');
});
beforeEach(() => cpSync(join(recorded, 'Ida'), person, { recursive: true }));
afterEach(async () => {
  await browser.close();
  rmSync(person, { recursive: true, force: true });
});
afterAll(() => server.stop());

/** Opens Ida's recording. */
async function open(width = 1280, height = 800): Promise<void> {
  browser = await Browser.launch({ width, height });
  page = browser.page;
  page.on('dialog', (dialog) => void dialog.accept());
  await page.goto(server.url);
  await page.click('#people button');
  await page.waitForSelector('#room:visible');
}

/** How far the making is said to be; of a stopped one, of the recordings and the body as they are now. */
function progress(state: string, more: Record<string, unknown> = {}): void {
  mkdirSync(join(person, 'making'), { recursive: true });
  const parts = JSON.parse(runPython('studio/signed.py', person)) as unknown[];
  const known = { state, quality: 'quick', step: 'learn', share: 0.42, advice: [], made_of: { parts, on: [] } };
  writeFileSync(join(person, 'making', 'progress.json'), JSON.stringify({ ...known, ...more }));
}

const bodyOf = () => JSON.parse(readFileSync(join(person, 'body.json'), 'utf8')) as object;
const visible = (...ids: string[]) => Promise.all(ids.map((id) => page.isVisible(`#${id}`)));

test('build and clothes of a body are chosen in pictures, kept, and said to be made', async () => {
  await open(390, 844);
  expect(await page.isChecked('#bodies [value=alone]')).toBe(true);
  expect(await page.isVisible('#looks')).toBe(false);
  expect(await page.textContent('#body-about')).toBe('All that is seen is recorded from you.');
  await page.check('#bodies [value=whole]');
  await page.waitForSelector('#looks:visible');
  await page.check('#bodies [value=sturdy]');
  await expect.poll(bodyOf).toEqual({ wanted: true, build: 'sturdy', outfit: 'recorded' });
  await page.check('#bodies [value=wine]');
  await expect.poll(bodyOf).toEqual({ wanted: true, build: 'sturdy', outfit: 'wine' });
  expect(await page.textContent('#body-about')).toMatch(/^Your head and face are recorded\. The body below the neck is made/);
  const pictures = () => page.$$eval('#looks label', (labels) => labels.map((label) => getComputedStyle(label, '::before').backgroundPosition));
  await expect.poll(pictures).toEqual(['100% 0%', '100% 50%', '100% 100%', '0% 100%', '50% 100%', '100% 100%']); // one sheet, outfits across
  expect(await page.evaluate(() => document.documentElement.scrollWidth - document.documentElement.clientWidth)).toBeLessThanOrEqual(0);
  await judge(page, 'studio body');
  await page.reload();
  await page.waitForSelector('#looks:visible');
  expect(await page.isChecked('#bodies [value=sturdy]')).toBe(true);
  expect(await page.isChecked('#bodies [value=wine]')).toBe(true);
  expect(await page.textContent('#title')).toBe('Ida');
});

test('a reload and the browser’s Back lead where one was', async () => {
  await open();
  await page.click('[data-part=left]');
  await page.reload();
  await page.waitForSelector('[data-part=left][aria-pressed=true]');
  await page.click('#back');
  await page.waitForSelector('#start:visible');
  await page.goBack();
  await page.waitForSelector('#room:visible');
  expect(await page.textContent('#title')).toBe('Ida');
  await page.goBack();
  await page.waitForSelector('#start:visible');
  await page.goForward();
  await page.waitForSelector('#room:visible');
});

test('a making that was stopped says where, and each of its buttons does what it says', async () => {
  progress('stopped');
  await open();
  expect(await page.textContent('#made')).toBe('Stopped at: Learning the face, 42 %');
  expect(await visible('again', 'anew', 'discard', 'halt', 'talk')).toEqual([true, true, true, false, false]);
  expect(await page.textContent('#choices')).toMatch(/^“Go on” continues where it stopped/);
  expect(await page.textContent('#go')).toBe('Start over');
  await judge(page, 'studio stopped');
  await page.click('#again');
  await page.waitForSelector('#halt:visible');
  expect(await page.isVisible('#room')).toBe(false);
  await page.click('#halt');
  await page.waitForSelector('#again:visible');
  writeFileSync(join(person, 'making', 'learnt'), '');
  await page.click('#anew');
  await page.waitForSelector('#halt:visible');
  expect(existsSync(join(person, 'making', 'learnt'))).toBe(false);
  await page.click('#halt');
  await page.click('#discard');
  await page.waitForSelector('#making', { state: 'hidden' });
  expect(existsSync(join(person, 'making'))).toBe(false);
  expect(await page.textContent('#go')).toBe('Make my avatar');
  expect(readdirSync(join(person, 'parts')).filter((name) => name.endsWith('.mp4'))).toEqual(['consent.mp4', 'left.mp4', 'text-1.mp4']);
});

test('how long each quality takes stands beside it once the server knows', async () => {
  await open();
  const quick = () => page.textContent('#quality [value=quick]');
  await expect.poll(quick).toMatch(/^quick, for a first impression \(about \d+ min\)$/);
  await page.selectOption('#language', 'de');
  expect(await quick()).toMatch(/^schnell, für einen ersten Eindruck \(etwa \d+ min\)$/);
  expect(await page.inputValue('#quality')).toBe('good');
  await judge(page, 'studio durations');
});

test('with other recordings nothing goes on, and that is said', async () => {
  progress('stopped', { made_of: { parts: [], on: [] } });
  await open();
  expect(await visible('again', 'anew', 'discard')).toEqual([false, true, true]);
  expect(await page.textContent('#choices')).toMatch(/^The recordings have changed since, so it starts over/);
});

test('what ends a making, and why there is no voice, is said in the language of the page', async () => {
  const silent = { code: 'voice-short', level: 'better', values: { n: 4, least: 10 }, spans: [], detail: '' };
  const lacking = { code: 'voice-lacking', level: 'better', values: {}, spans: [], detail: 'openvoice is not installed.' };
  const failed = { error: 'in English', code: 'disk-room', values: { free: 0.1, needed: 0.5 } };
  progress('failed', { ...failed, advice: [silent, lacking] });
  await open();
  await page.selectOption('#language', 'de');
  const shown = () => page.textContent('#error');
  expect(await shown()).toBe('Auf der Festplatte sind noch 0,1 GB frei, und 0,5 GB braucht es: Schaffen Sie Platz.');
  expect(await visible('again', 'detail')).toEqual([true, false]);
  const reasons = await page.$$eval('#betters li > span', (spans) => spans.map((span) => span.textContent));
  expect(reasons).toEqual([
    'Der Avatar entsteht ohne eigene Stimme: 4 s Sprache sind zu hören, und 10 s braucht es: Sprechen Sie mehr.',
    'Der Avatar entsteht ohne eigene Stimme: OpenVoice, das Stimmen nachahmt, ist hier nicht oder nicht ganz installiert.',
  ]);
  expect(await page.isVisible('#betters details p')).toBe(false);
  await page.click('#betters summary');
  expect(await page.textContent('#betters details p:visible')).toBe('openvoice is not installed.');
  await page.selectOption('#language', 'fr');
  expect(await shown()).toBe('Il reste 0,1 Go sur le disque et il en faut 0,5 Go : libérez de la place.');
  await judge(page, 'studio failed');

  progress('failed', { error: 'ZeroDivisionError: division by zero' });
  await page.reload();
  await page.waitForSelector('#detail:visible');
  expect(await shown()).toBe(
    'Un imprévu a arrêté la création ; ce que vous avez enregistré est conservé. Appuyez sur « Continuer à partir de là » pour reprendre.',
  );
  expect(await page.isVisible('#technical')).toBe(false);
  await page.click('#detail summary');
  expect(await page.textContent('#technical:visible')).toBe('ZeroDivisionError: division by zero');
  expect(await page.getAttribute('#technical', 'lang')).toBe('en');
  await judge(page, 'studio unforeseen');
});

test('a making that the system kills is said in the language of the page, and goes on', async () => {
  progress('stopped');
  await open();
  await page.selectOption('#language', 'es');
  await page.click('#again');
  await page.waitForSelector('#halt:visible');
  runPython('studio/killed.py', person);
  await page.waitForSelector('#again:visible');
  expect(await page.textContent('#error')).toMatch(/^La creación fue interrumpida a la fuerza, como ocurre cuando falta memoria/);
  await page.click('#again');
  await page.waitForSelector('#halt:visible');
  expect(await page.textContent('#error')).toBe('');
  await page.click('#halt');
  await page.waitForSelector('#again:visible');
});

test.skipIf(!hasTracker)('recordings without a face are refused in the language of the page, and stay', async () => {
  await open();
  await page.selectOption('#language', 'de');
  await page.selectOption('#quality', 'quick');
  await page.click('#go');
  await page.waitForSelector('#anew:visible');
  expect(await page.textContent('#error')).toMatch(/^Kein Gesicht gefunden: Filmen Sie einen wirklichen Menschen/);
  expect(await visible('again', 'anew', 'discard')).toEqual([false, true, true]);
  expect(await page.textContent('#choices')).toMatch(/^Von dort geht es mit diesen Aufnahmen nicht weiter/);
  expect(readdirSync(join(person, 'parts'))).toContain('text-1.mp4');
});

test.skipIf(!hasTracker)('a video without a face is not kept, and the page says what create says', async () => {
  await open(390, 844);
  await page.selectOption('#language', 'fr');
  await page.setInputFiles('#file', grey);
  await page.waitForSelector('#problem:visible');
  expect(await page.textContent('#problem')).toMatch(/^Aucun avatar ne peut être créé à partir de cette vidéo.* Aucun visage trouvé : filmez/);
  expect(readdirSync(join(person, 'parts')).filter((name) => name.startsWith('upload'))).toEqual([]);
  expect(await page.isVisible('[data-part=upload]')).toBe(false);
});

test.skipIf(!demo)('the talk’s Back leads to the finished person, who is not made again for nothing', async () => {
  copyFileSync(demo!, join(person, 'Ida.ico3d'));
  progress('made', { step: 'bake', share: 1, decibels: 31.24 });
  await open();
  expect(await page.textContent('#made')).toBe('Ida is there');
  expect(await page.textContent('#made-of')).toBe('Recorded: all that is seen, head and shoulders.');
  expect(await page.textContent('#decibels')).toBe('Very like the recording (31.2 dB on pictures it never saw)');
  await page.selectOption('#quality', 'quick');
  expect(await page.isDisabled('#go')).toBe(true);
  expect(await page.textContent('#first')).toMatch(/^It is there, made in just this way/);
  await page.selectOption('#quality', 'best');
  expect(await page.isDisabled('#go')).toBe(false);
  expect(await page.textContent('#go')).toBe('Make it again');
  await page.click('#talk');
  await page.waitForURL((url) => !url.href.startsWith(server.url));
  await page.goBack();
  await page.waitForSelector('#talk:visible');
  expect(await page.textContent('#title')).toBe('Ida');
  expect(await page.textContent('#talk')).toBe('Talk with the avatar');
  expect(await page.isDisabled('#talk')).toBe(false);
  await page.goForward();
  await page.waitForURL((url) => !url.href.startsWith(server.url));
  await page.waitForSelector('#overlay.gone', { state: 'attached' });
  const back = page.locator('header .way-back');
  expect(await back.textContent()).toBe('Back to the studio');
  await judge(page, 'talk of the studio');
  await page.setViewportSize({ width: 390, height: 844 });
  const views = await page.locator('.views').boundingBox();
  const link = await back.boundingBox();
  expect(link!.y + link!.height).toBeLessThanOrEqual(views!.y);
  await back.click();
  await page.waitForSelector('#talk:visible');
  expect(await page.textContent('#title')).toBe('Ida');
});

test('a tab on somebody who was deleted elsewhere says so by itself, and a new recording can begin', async () => {
  await open();
  rmSync(person, { recursive: true });
  await page.waitForSelector('#start:visible');
  await expect.poll(() => page.textContent('#problem')).toBe(
    'Ida was deleted elsewhere, in another tab or by hand: begin a new recording here.',
  );
  expect(await page.evaluate(() => document.activeElement?.id)).toBe('name');
  expect(page.url()).not.toContain('Ida');
});

test('a voice is agreed to by a tick of its own, off at first, in the language of the page', async () => {
  browser = await Browser.launch({ width: 390, height: 844 });
  page = browser.page;
  await page.goto(server.url);
  await page.waitForSelector('#voice-tick:visible');
  expect(await page.isChecked('#voice')).toBe(false);
  await judge(page, 'studio voice');
  await page.selectOption('#language', 'de');
  await expect.poll(() => page.textContent('#voice-sentence')).toMatch(/^Ich bin auch einverstanden, .* meiner Stimme/);
  for (const [name, ticks] of [['Una', ['#agreed', '#voice']], ['Ada', ['#agreed']]] as const) {
    await page.fill('#name', name);
    for (const tick of ticks) await page.check(tick);
    await page.click('#begin');
    await page.waitForSelector('#room:visible');
    const consent = JSON.parse(readFileSync(join(folder, name, 'consent.json'), 'utf8')) as Record<string, string>;
    expect('voice_consent' in consent).toBe(name === 'Una');
    expect((await page.textContent('#text'))!.includes('Stimme')).toBe(name === 'Una');
    await page.click('#back');
    await page.waitForSelector('#start:visible');
  }
});
