import { afterAll, beforeAll, expect, inject, test } from 'vitest';
import { Browser } from '../../support/browser/browser.ts';
import { ChatServer } from '../../support/servers/server.ts';
import { Site } from '../../support/servers/site.ts';

let server: ChatServer;
let site: Site;

beforeAll(async () => {
  site = await Site.open(
    () => `<!doctype html><title>Site</title><ico3d-avatar autoconnect server="${server.url}" style="width: 160px; height: 160px"></ico3d-avatar>
      <script type="module" src="${server.url}embed.js"></script>`,
  );
  server = await ChatServer.start(inject('shared').talking, 0, '--allow-origin', site.origin);
});
afterAll(async () => {
  site?.close();
  await server?.stop();
});

/** Sets attributes of the element, in this order, and cuts its line; the token with which it comes back. */
async function tokenAfter(browser: Browser, attributes: Record<string, string>): Promise<string | null> {
  const { page } = browser;
  const before = await page.evaluate(() => window.sockets.length);
  await page.evaluate((given) => {
    const element = document.querySelector('ico3d-avatar')!;
    for (const [name, value] of Object.entries(given)) element.setAttribute(name, value);
    setTimeout(() => window.sockets.at(-1)!.close());
  }, attributes);
  await page.waitForFunction((count) => window.sockets.length > count, before, { timeout: 30_000 });
  return page.evaluate(() => new URL(window.sockets.at(-1)!.url).searchParams.get('token'));
}

test('a new token goes to the server that it is for', async () => {
  const browser = await Browser.launch({ width: 400, height: 360, calm: true });
  const { page } = browser;
  await page.addInitScript(() => {
    window.sockets = [];
    window.WebSocket = new Proxy(WebSocket, {
      construct: (kind, given: [string]) => {
        const made = new kind(...given);
        window.sockets.push(made);
        return made;
      },
    });
  });
  await page.goto(site.origin);
  await page.waitForFunction(() => document.querySelector('ico3d-avatar')?.shadowRoot?.querySelector('[data-state="idle"], [data-state="speaking"]'), undefined, { timeout: 60_000 });
  expect(await tokenAfter(browser, { token: 'first' })).toBe('first');
  const elsewhere = 'http://127.0.0.1:9/';
  expect(await tokenAfter(browser, { token: 'of-another', server: elsewhere })).toBe('first');
  expect(await tokenAfter(browser, { token: 'of-a-third', avatar: 'ada' })).toBe('first');
  await page.evaluate(() => document.querySelector('ico3d-avatar')!.removeAttribute('avatar'));
  expect(await tokenAfter(browser, { server: server.url, token: 'second' })).toBe('second');
  await browser.close();
}, 120_000);
