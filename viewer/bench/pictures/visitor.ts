import type { Page, WebSocketRoute } from 'playwright-core';
import { Browser, type BrowserOptions } from '../../support/browser/browser.ts';
import { refreshed } from '../../support/browser/drawing.ts';
import { drawnBy } from '../../support/browser/path.ts';

/** How somebody comes. */
export interface Visit extends BrowserOptions {
  draw?: 'soft' | 'webgl'; // what draws the avatar
  light?: boolean;
  language?: string;
  typing?: boolean; // whether the talk begins at once
}

/** Words of the packaged person: an answer of several sentences belongs to them. */
export const QUESTION = 'How do you work?';

/**
 * Opens the page as a visitor would find it: light or dark, in a language, drawn by the processor
 * alone unless something else is asked for.
 */
export async function arrive(url: string, visit: Visit = {}): Promise<Browser> {
  const { draw = 'soft', light = false, language = 'en', typing = true, ...options } = visit;
  const browser = await Browser.launch({ width: 1280, height: 800, calm: true, ...options });
  const { page } = browser;
  await page.emulateMedia({ colorScheme: light ? 'light' : 'dark', reducedMotion: 'reduce' });
  await page.addInitScript((language) => localStorage.setItem('ico3d-language', language), language);
  const address = drawnBy(draw, url);
  if (!typing) await page.goto(address);
  else {
    await browser.open(address);
    await greeted(page);
  }
  return browser;
}

/** Waits until the greeting is over. */
export async function greeted(page: Page): Promise<void> {
  await page.waitForFunction(() => document.body.dataset.state === 'speaking', undefined, { timeout: 60_000 });
  await silent(page);
}

/** Waits until nobody speaks. */
export async function silent(page: Page): Promise<void> {
  await page.waitForFunction(() => document.body.dataset.state === 'idle' && !window.ico3d!.conversation!.player.heard(), undefined, { timeout: 60_000 });
  await refreshed(page);
}

/** Asks, and waits until some words of the answer were heard. */
export async function ask(page: Page, question = QUESTION): Promise<void> {
  await page.fill('#text', question);
  await page.keyboard.press('Enter');
  await page.waitForFunction(
    () => document.body.dataset.state === 'speaking' && document.querySelector('#answer > :first-child')!.textContent!.length > 25,
    undefined,
    { timeout: 30_000 },
  );
}

/** The line between a page and its server, which can be kept from going on. */
export class Line {
  /** Is told every text message of the server. */
  onText: (text: string) => void = () => {};
  private readonly sockets: WebSocketRoute[] = [];
  private down = false;
  private held = false;

  /**
   * Leads the page's line through here; before the page is opened.
   *
   * @param hold the server's message after which no answer comes, while `held`
   */
  static async through(page: Page, hold?: RegExp): Promise<Line> {
    const line = new Line();
    await page.routeWebSocket(/\/ws/, (socket) => line.open(socket, hold));
    return line;
  }

  private open(socket: WebSocketRoute, hold?: RegExp): void {
    if (this.down) return void socket.close();
    this.sockets.push(socket);
    const server = socket.connectToServer();
    let holds = false;
    server.onMessage((message) => {
      if (typeof message === 'string') this.onText(message);
      if (!holds || isAcknowledgement(message)) socket.send(message);
      if (this.held && typeof message === 'string' && hold?.test(message)) holds = true;
    });
  }

  /** From now on the server answers nothing after the message in question, but still takes sound. */
  hold(): void {
    this.held = true;
  }

  /** The network is gone. */
  async cut(): Promise<void> {
    this.down = true;
    for (const socket of this.sockets.splice(0)) await socket.close({ code: 4000 });
  }
}

/** Without these the page would say that the line stalls. */
function isAcknowledgement(message: string | Buffer): boolean {
  return typeof message === 'string' && JSON.parse(message).type === 'ack';
}
