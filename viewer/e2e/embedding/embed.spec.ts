import { readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import type { Page } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, inject, test } from 'vitest';
import type { mountAvatar } from '../../src/embed/api.ts';
import type { Presence } from '../../src/visit.ts';
import { judge } from '../../support/browser/axe.ts';
import { Browser } from '../../support/browser/browser.ts';
import { REPOSITORY } from '../../support/python.ts';
import { scratchFolder } from '../../support/scratch.ts';
import { ChatServer } from '../../support/servers/server.ts';
import { Site } from '../../support/servers/site.ts';

/** What happened on somebody's page. */
interface Told {
  type: string;
  detail: { [field: string]: unknown };
}

declare global {
  interface Window {
    told: Told[];
    sockets: WebSocket[];
    contexts: AudioContext[];
    mountAvatar: typeof mountAvatar;
  }
}

const EXAMPLE = readFileSync(join(REPOSITORY, 'examples/embedding/index.html'), 'utf8');
const BOARD = 'background: conic-gradient(#fff 25%, #000 0 50%, #fff 0 75%, #000 0) 0 0 / 16px 16px';
const EVENTS = ['ready', 'state', 'user-transcript', 'avatar-transcript', 'speak-start', 'speak-end', 'gesture', 'tool-call', 'error'];

let server: ChatServer;
let site: Site;

/** The page of a site at a path: the documented example, or other elements instead of its own. */
function pageOf(path: string): string {
  const example = EXAMPLE.replace('http://127.0.0.1:8765/', server.url);
  const own: Record<string, string> = {
    '/example': example,
    '/inline': example.replace(/<ico3d-avatar.*>/, '<ico3d-avatar autoconnect style="width: 320px; height: 240px"></ico3d-avatar>'),
    '/clear': example.replace(/<ico3d-avatar.*>/, `<ico3d-avatar transparent draw="webgl" autoconnect style="width: 320px; height: 240px; ${BOARD}"></ico3d-avatar>`),
    '/soft': example.replace(/<ico3d-avatar.*>/, `<ico3d-avatar transparent autoconnect style="width: 320px; height: 240px; ${BOARD}"></ico3d-avatar>`),
    '/french': `<!doctype html><html lang="de"><title>Site</title><main><h1>Site</h1>
      <ico3d-avatar lang="fr" style="max-width: 100%"></ico3d-avatar><ico3d-avatar mode="floating"></ico3d-avatar></main>
      <script type="module" src="${server.url}embed.js"></script></html>`,
    '/two': example.replace(/<ico3d-avatar.*>/, '<ico3d-avatar autoconnect style="width: 160px; height: 160px"></ico3d-avatar>'.repeat(2)),
    '/elsewhere': example.replace(/<ico3d-avatar.*>/, ['javascript:alert(1)', 'data:text/html,a', 'blob:x'].map((where) => `<ico3d-avatar lang="en" server="${where}"></ico3d-avatar>`).join('')),
    '/framed': `<iframe src="${server.url}check" width="400" height="340"></iframe>`,
    '/alone': `<div id="place" style="width: 160px; height: 160px"></div>
      <script type="module">
        import { mountAvatar } from '${server.url}embed.js';
        Object.assign(window, { mountAvatar });
      </script>`,
  };
  return own[path] ?? '';
}

beforeAll(async () => {
  site = await Site.open(pageOf);
  const settings = join(scratchFolder(), 'saying.toml');
  writeFileSync(settings, '[embedding]\nsay = true\n');
  server = await ChatServer.start(inject('shared').talking, 0, '--allow-origin', site.origin, '--settings', settings);
});
afterAll(async () => {
  site?.close();
  await server?.stop();
});

/** Opens a page of the site, which notes what it is told and what it opens. */
async function visit(path: string, origin = site.origin): Promise<{ browser: Browser; page: Page }> {
  const browser = await Browser.launch({ width: 400, height: 360, calm: true });
  const { page } = browser;
  await page.addInitScript((events) => {
    Object.assign(window, { told: [], sockets: [], contexts: [] });
    const noting = <T extends object>(of: new (...given: never[]) => T, kept: T[]) =>
      new Proxy(of, { construct: (target, given) => (kept.push(Reflect.construct(target, given) as T), kept.at(-1)!) });
    window.WebSocket = noting(WebSocket, window.sockets) as typeof WebSocket;
    window.AudioContext = noting(AudioContext, window.contexts) as typeof AudioContext;
    const note = ({ type, detail }: Event & { detail?: Told['detail'] }) => detail && window.told.push({ type, detail });
    for (const event of events) addEventListener(event, note as EventListener);
  }, EVENTS);
  await page.goto(origin + path);
  return { browser, page };
}

/** Waits until something of a kind was told. */
async function heard(page: Page, type: string, detail: Told['detail'] = {}): Promise<void> {
  await page.waitForFunction(
    ([type, detail]) =>
      window.told.some((told) => told.type === type && Object.entries(detail).every(([key, value]) => told.detail[key] === value)),
    [type, detail] as const,
  );
}

describe('an avatar in the page of another origin', () => {
  let browser: Browser;
  let page: Page;
  beforeAll(async () => {
    ({ browser, page } = await visit('/inline'));
    await heard(page, 'ready');
  });
  afterAll(() => browser?.close());

  test('answers what is typed, and tells the page', async () => {
    await heard(page, 'speak-end', { utterance: 0 }); // the greeting
    await page.locator('#text').fill('Who are you?');
    await page.keyboard.press('Enter');
    await heard(page, 'speak-end', { utterance: 1, interrupted: false });
    const told = await page.evaluate(() => window.told);
    const of = (type: string) => told.filter((event) => event.type === type).map(({ detail }) => detail);
    expect(of('ready')).toEqual([{ name: expect.any(String) }]);
    expect(of('user-transcript')).toEqual([{ text: 'Who are you?', final: true }]);
    expect(of('avatar-transcript').at(-1)).toEqual({ text: 'I am Stella.' });
    expect(of('speak-start')).toEqual([{ utterance: 0 }, { utterance: 1 }]);
    expect(of('state').map(({ state }) => state)).toEqual(expect.arrayContaining(['connecting', 'idle', 'speaking']));
    expect(of('error')).toEqual([]);
  });

  test('says what the page wants it to, until it is interrupted', async () => {
    const said = await page.evaluate(() => {
      const avatar = document.querySelector('ico3d-avatar')!;
      avatar.setVolume(0.25);
      return avatar.say('The next train to the coast leaves from platform nine in twenty minutes.');
    });
    expect(said).toBe(true);
    await heard(page, 'speak-start', { utterance: 2 });
    await page.evaluate(() => document.querySelector('ico3d-avatar')!.interrupt());
    await heard(page, 'speak-end', { utterance: 2, interrupted: true });
    await page.evaluate(() => document.querySelector('ico3d-avatar')!.send('Who are you?'));
    await heard(page, 'speak-start', { utterance: 3 });
    const refusal = await page.evaluate(() => document.querySelector('ico3d-avatar')!.enterXR().catch((error: Error) => error.message));
    expect(refusal).toMatch(/^This avatar cannot be entered/);
  });

  test('tells of gestures and of functions that are called, and has a volume', async () => {
    const cue = { number: 0, name: 'wave', mirror: false, begin: 0.5, stroke: 0.9, skip: 0 };
    const levels = await page.evaluate((cue) => {
      const say = (message: object) => window.sockets[0]!.onmessage!(new MessageEvent('message', { data: JSON.stringify(message) }));
      say({ type: 'cues', utterance: 9, cues: [cue], releases: [] });
      say({ type: 'call', name: 'open_door', arguments: '{"side": "left"}' });
      const avatar = document.querySelector('ico3d-avatar')!;
      const { output } = (avatar as unknown as { talk: { presence: Presence } }).talk.presence.conversation!.player;
      return [0.25, 7, -1].map((volume) => {
        avatar.setVolume(volume);
        return output.gain.value;
      });
    }, cue);
    expect(levels).toEqual([0.25, 1, 0]);
    await heard(page, 'gesture', { utterance: 9, name: 'wave', mirror: false, begin: 0.5, stroke: 0.9 });
    await heard(page, 'tool-call', { name: 'open_door' });
    const call = await page.evaluate(() => window.told.find(({ type }) => type === 'tool-call')!.detail.arguments);
    expect(call).toEqual({ side: 'left' });
  });

  test('leaves the page around it as it was, and nothing behind', async () => {
    const before = await page.evaluate(() => ({
      title: document.title,
      attributes: [document.documentElement, document.body].map((element) => element.attributes.length),
      focus: document.activeElement!.localName, // it was typed in
    }));
    expect(before).toEqual({ title: 'My site', attributes: [1, 0], focus: 'ico3d-avatar' });
    await page.evaluate(() => document.querySelector('ico3d-avatar')!.remove());
    await page.waitForFunction(() => window.sockets.every(({ readyState }) => readyState === WebSocket.CLOSED));
    await page.waitForFunction(() => window.contexts.every(({ state }) => state === 'closed'));
    expect(await page.evaluate(() => [window.sockets.length, window.contexts.length])).toEqual([1, 1]);
    expect(await page.evaluate(() => Object.keys(sessionStorage))).toEqual([]); // of the talk, which is over, the site's storage has nothing
  });

  test('is nothing on a site that the server does not know', async () => {
    const stranger = await visit('/inline', site.origin.replace('127.0.0.1', 'localhost'));
    await stranger.page.waitForLoadState('load');
    expect(await stranger.page.evaluate(() => customElements.get('ico3d-avatar') === undefined)).toBe(true);
    await stranger.browser.close();
  });
});

test('an address that no server can have is told, and nothing else', async () => {
  const { browser, page } = await visit('/elsewhere');
  const errors: string[] = [];
  page.on('pageerror', ({ message }) => errors.push(message));
  await page.reload();
  await page.waitForFunction(() => [...document.querySelectorAll('ico3d-avatar')].every(({ shadowRoot }) => shadowRoot?.textContent?.includes('address')));
  expect(errors).toEqual([]);
  await browser.close();
});

test('two on one page have a talk each, and one stays when the other goes', async () => {
  const { browser, page } = await visit('/two');
  await page.waitForFunction(() => window.told.filter(({ type }) => type === 'ready').length === 2);
  const asked = await page.evaluate(() => {
    const from: number[] = [];
    const avatars = [...document.querySelectorAll('ico3d-avatar')];
    for (const [i, avatar] of avatars.entries()) avatar.addEventListener('user-transcript', () => from.push(i));
    avatars[1]!.send('Who are you?');
    avatars[0]!.remove();
    return { from, sent: avatars.map((avatar) => avatar.send('Who are you?')) };
  });
  expect(asked).toEqual({ from: [1, 1], sent: [false, true] });
  await heard(page, 'avatar-transcript', { text: 'I am Stella.' });
  expect(await page.evaluate(() => window.contexts.map(({ state }) => state).sort())).toEqual(['closed', 'running']);
  await browser.close();
});

test('in a frame that is not given the microphone, the page says so', async () => {
  const { browser, page } = await visit('/framed');
  const microphone = page.frameLocator('iframe').locator('#microphone');
  await microphone.locator('button').click();
  await expect.poll(() => microphone.locator('.words').textContent()).toMatch(/^The site around this page does not give it the microphone/);
  await browser.close();
});

test('the floating one is worked with the keyboard alone', async () => {
  const { browser, page } = await visit('/example');
  await page.waitForFunction(() => document.querySelector('ico3d-avatar')?.shadowRoot);
  const inside = () => page.evaluate(() => document.querySelector('ico3d-avatar')!.shadowRoot!.activeElement?.id);
  await page.keyboard.press('Tab');
  expect(await inside()).toBe('launcher');
  await page.keyboard.press('Enter');
  await heard(page, 'ready');
  await heard(page, 'speak-end', { utterance: 0 });
  for (let steps = 0; (await inside()) !== 'text' && steps < 12; steps++) await page.keyboard.press('Tab');
  await page.keyboard.type('Who are you?');
  await page.keyboard.press('Enter');
  await heard(page, 'speak-end', { utterance: 1 });
  for (let steps = 0; (await inside()) !== 'launcher' && steps < 12; steps++) await page.keyboard.press('Tab');
  await page.keyboard.press('Enter');
  await page.waitForFunction(() => window.sockets.every(({ readyState }) => readyState === WebSocket.CLOSED));
  expect(await inside()).toBe('launcher');
  expect(await page.evaluate(() => document.querySelector('ico3d-avatar')!.hasAttribute('open'))).toBe(false);

  await page.keyboard.press('Enter'); // what was said is still there, and nowhere in the site's storage
  await page.waitForFunction(() => window.told.filter(({ type }) => type === 'ready').length === 2);
  const said = await page.evaluate(() => document.querySelector('ico3d-avatar')!.shadowRoot!.getElementById('record')!.textContent);
  expect(said).toMatch(/^Earlier: Stella no longer knows this.*Who are you\?.*I am Stella\..*A new conversation/);
  expect(await page.evaluate(() => Object.keys(sessionStorage))).toEqual([]);
  await browser.close();
});

test('the floating one shows the question and four lines of the answer', async () => {
  const { browser, page } = await visit('/example');
  await page.setViewportSize({ width: 1280, height: 800 });
  await page.locator('#launcher').click();
  await heard(page, 'speak-end', { utterance: 0 });
  await page.locator('#text').fill('Who are you?');
  await page.keyboard.press('Enter');
  await heard(page, 'speak-end', { utterance: 1 });
  const asked = await page.locator('#question').boundingBox();
  const lines = await page.locator('#answer').evaluate((answer) => {
    answer.firstElementChild!.textContent = 'Words that fill a line, and then another one. '.repeat(8);
    return answer.clientHeight / parseFloat(getComputedStyle(answer).lineHeight);
  });
  expect(asked!.height).toBeGreaterThan(10);
  expect(lines).toBeCloseTo(4, 1);
  await browser.close();
});

test('around a transparent one the page is seen, through the edges of Gaussians too', async () => {
  const { browser, page } = await visit('/clear');
  await heard(page, 'ready');
  const off = await page.evaluate(async () => {
    const avatar = document.querySelector('ico3d-avatar')! as unknown as { talk: { presence: Presence } };
    const { stage } = avatar.talk.presence;
    await stage.still();
    const { renderer } = stage;
    const gl = renderer.getContext();
    const { drawingBufferWidth: width, drawingBufferHeight: height } = gl;
    const read = (colour: number, alpha: number) => {
      renderer.setClearColor(colour, alpha);
      stage.draw();
      const pixels = new Uint8Array(4 * width * height);
      gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
      return pixels;
    };
    const clear = read(0x000000, 0);
    const worst = [0xffffff, 0x000000].map((colour) => {
      const solid = read(colour, 1);
      let off = 0;
      let sum = 0;
      for (let i = 0; i < clear.length; i += 4) {
        const through = (1 - clear[i + 3]! / 255) * (colour & 255);
        for (let c = 0; c < 3; c++) {
          const here = Math.abs(clear[i + c]! + through - solid[i + c]!);
          off = Math.max(off, here);
          sum += here;
        }
      }
      return { off, mean: sum / (3 * width * height) };
    });
    read(0x000000, 0);
    const alphas = clear.filter((_, i) => i % 4 === 3);
    const share = (test: (alpha: number) => boolean) => alphas.filter(test).length / alphas.length;
    return { worst, empty: share((a) => a === 0), edge: share((a) => a > 25 && a < 230), corner: clear[3] };
  });
  expect(off.corner).toBe(0);
  expect(off.empty).toBeGreaterThan(0.05);
  expect(off.edge).toBeGreaterThan(0.01);
  for (const { off: most, mean } of off.worst) {
    expect(most).toBeLessThanOrEqual(10); // levels: what many layers round away
    expect(mean).toBeLessThan(0.5);
  }
  await browser.close();
});

test('around a transparent one that the processor draws the page is seen, too', async () => {
  const { browser, page } = await visit('/soft');
  await heard(page, 'ready');
  const drawn = await page.evaluate(async () => {
    const avatar = document.querySelector('ico3d-avatar')! as unknown as { talk: { presence: Presence } };
    const { stage } = avatar.talk.presence;
    await stage.still();
    const canvas = document.querySelector('ico3d-avatar')!.shadowRoot!.querySelector<HTMLCanvasElement>('#stage')!;
    const { data } = canvas.getContext('2d')!.getImageData(0, 0, canvas.width, canvas.height);
    const alphas = data.filter((_, i) => i % 4 === 3);
    const share = (test: (alpha: number) => boolean) => alphas.filter(test).length / alphas.length;
    const scripts = performance.getEntriesByType('resource').filter(({ name }) => /assets\/(spark|three-webgl)-/.test(name));
    return { path: stage.painter.path, corner: alphas[0], empty: share((a) => a === 0), edge: share((a) => a > 25 && a < 230), shared: crossOriginIsolated, scripts: scripts.length };
  });
  expect(drawn).toMatchObject({ path: 'soft', corner: 0, shared: false, scripts: 0 });
  expect(drawn.empty).toBeGreaterThan(0.05);
  expect(drawn.edge).toBeGreaterThan(0.01);
  const refusal = await page.evaluate(() => document.querySelector('ico3d-avatar')!.enterXR().catch((error: Error) => error.message));
  expect(refusal).toMatch(/^This avatar cannot be entered/);
  await browser.close();
});

test('an avatar alone shows the face and speaks the sound that it is given', async () => {
  const { browser, page } = await visit('/alone');
  await page.waitForFunction(() => window.mountAvatar);
  const shown = await page.evaluate(async (url) => {
    const handle = await window.mountAvatar(document.querySelector<HTMLElement>('#place')!, { bundle: `${url}bundle`, calm: true });
    const { head } = (handle as unknown as { cast: { head: { expression: Float32Array } } }).cast;
    const size = handle.expressionSize;
    const until = async (value: number) => {
      while (Math.abs(head.expression[0]! - value) > 1e-3) await new Promise((resolve) => requestAnimationFrame(resolve));
    };
    handle.express(new Float32Array(size).fill(0.5));
    const kept = [...head.expression];
    handle.express(null);
    handle.feed({ pcm: new Int16Array(24_000), face: new Float32Array(25 * size).fill(0.75) }); // a second
    await until(0.75);
    handle.end();
    const gesture = handle.gesture('wave');
    handle.dispose();
    handle.dispose();
    return { size, kept, gesture, left: document.querySelectorAll('canvas').length, states: window.contexts.map(({ state }) => state) };
  }, server.url);
  expect(shown.kept).toEqual(new Array(shown.size).fill(0.5));
  expect(shown).toMatchObject({ gesture: false, left: 0 });
  await browser.close();
});

describe('an inline one in the language that its site gives it', () => {
  let browser: Browser;
  let page: Page;
  const avatar = () => page.locator('ico3d-avatar').first();
  const theme = () => avatar().locator('#page').getAttribute('data-theme');
  beforeAll(async () => {
    ({ browser, page } = await visit('/french'));
    await avatar().locator('#choices').waitFor();
  });
  afterAll(() => browser?.close());

  test('begins light or dark, as the visitor’s system is', async () => {
    const words = () => avatar().locator('#overlay').evaluate((overlay) => getComputedStyle(overlay).color.match(/[\d.]+/g)!.map(Number)[0]!);
    expect([await theme(), (await words()) < 60]).toEqual(['light', true]);
    await page.emulateMedia({ colorScheme: 'dark' });
    await expect.poll(theme).toBe('dark');
    expect(await words()).toBeGreaterThan(200);
    await page.emulateMedia({ colorScheme: 'light' });
    await expect.poll(theme).toBe('light');
  });

  test('goes on as it began, and axe finds nothing serious', async () => {
    expect(await avatar().locator('#start').textContent()).toBe('Commencer à parler');
    expect(await avatar().locator('#page').getAttribute('lang')).toBe('fr');
    expect(await page.locator('#launcher').last().getAttribute('aria-label')).toBe('Talk with the avatar');
    await judge(page, 'embedded-invitation');
    await avatar().locator('#start-typing').click();
    await heard(page, 'ready');
    expect(await theme()).toBe('light');
    await avatar().locator('#drawer-button').click();
    await avatar().locator('#record .avatar').waitFor();
    expect(await avatar().locator('#state').textContent()).toMatch(/^(Parle|Prêt)$/);
    await page.evaluate(() => (document.querySelector('ico3d-avatar')!.lang = 'ja'));
    expect(await avatar().locator('#drawer h2').textContent()).toBe('会話の記録');
    expect(await page.evaluate(() => document.documentElement.lang)).toBe('de'); // the site's own
    await judge(page, 'embedded');
  });
});
