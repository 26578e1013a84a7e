import { mkdtempSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { chromium, type BrowserContext, type Page } from 'playwright-core';

const FLAGS = [
  '--headless=new',
  '--no-sandbox',
  '--disable-quic',
  '--no-first-run',
  '--disable-background-networking',
  '--disable-component-update',
  '--disable-sync',
  '--use-angle=swiftshader',
  '--enable-unsafe-swiftshader',
];
const AUTOPLAY = '--autoplay-policy=no-user-gesture-required';

/** How a browser is started. */
export interface BrowserOptions {
  width?: number;
  height?: number;
  autoplay?: boolean; // sound without a click; default true
  calm?: boolean; // the visitor wants little motion: the head does not sway
  microphone?: string; // WAV that plays as the microphone, once
}

/** A software-rendered Chromium with one page. */
export class Browser {
  private readonly profile: string;
  readonly context: BrowserContext;
  readonly page: Page;

  private constructor(profile: string, context: BrowserContext, page: Page) {
    this.profile = profile;
    this.context = context;
    this.page = page;
    page.on('console', (message) => {
      if (message.type() === 'error' && !message.text().includes('WebSocket')) console.error('page:', message.text());
    });
    page.on('pageerror', (error) => console.error('page:', error));
  }

  static async launch(options: BrowserOptions = {}): Promise<Browser> {
    const { width = 320, height = 240, autoplay = true, calm = false, microphone } = options;
    const profile = mkdtempSync(join(tmpdir(), 'ico3d-browser-'));
    const args = [...FLAGS];
    if (autoplay) args.push(AUTOPLAY);
    if (microphone) {
      args.push('--use-fake-device-for-media-stream', '--use-fake-ui-for-media-stream');
      args.push(`--use-file-for-fake-audio-capture=${microphone}%noloop`);
    }
    const context = await chromium.launchPersistentContext(profile, {
      executablePath: process.env.CHROMIUM ?? '/usr/bin/chromium',
      headless: false, // the flag says it: playwright's own switch picks another build
      args,
      viewport: { width, height },
      deviceScaleFactor: 1,
      reducedMotion: calm ? 'reduce' : 'no-preference',
    });
    return new Browser(profile, context, context.pages()[0] ?? (await context.newPage()));
  }

  /** Opens the page and waits until the avatar is on stage. */
  async open(url: string): Promise<Page> {
    await this.page.goto(url, { timeout: 60_000 });
    await this.page.waitForFunction(() => window.ico3d !== undefined, undefined, { timeout: 60_000 });
    return this.page;
  }

  async close(): Promise<void> {
    await this.context.close();
    rmSync(this.profile, { recursive: true, force: true });
  }
}
