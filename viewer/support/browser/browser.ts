import { copyFileSync } from 'node:fs';
import { join } from 'node:path';
import { setTimeout as sleep } from 'node:timers/promises';
import { chromium, type Browser as Chromium, type BrowserContext, type Page } from 'playwright-core';
import { PATIENCE } from '../patience.ts';
import { scratchFolder } from '../scratch.ts';

const WITHOUT = [
  // Each window would fill the popups of its address bar, hidden, at the cost of another page.
  'WebUIOmniboxPopup',
  'WebUIOmniboxAimPopup',
  // What playwright goes without, too: its list is replaced by this one.
  'AvoidCorsURLLoaderRestartOnRedirect',
  'AvoidUnnecessaryBeforeUnloadCheckSync',
  'DestroyProfileOnBrowserClose',
  'HttpsFirstBalancedModeAutoEnable',
  'HttpsUpgrades',
  'LensOverlay',
  'MediaRouter',
  'NetworkTimeServiceQuerying',
  'OptimizationHints',
  'PaintHolding',
  'PreconnectToSearch',
  'ThirdPartyStoragePartitioning',
];
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
  '--disable-gpu-compositing', // only WebGL is drawn by the software GPU, which is slow at putting a page together
  '--autoplay-policy=no-user-gesture-required',
  `--disable-features=${WITHOUT.join()}`,
];
/** What the fake microphone plays, once, each time that it is opened. */
const HEARD = join(scratchFolder(), 'microphone.wav');
const MICROPHONE = [
  '--use-fake-device-for-media-stream',
  '--use-fake-ui-for-media-stream',
  `--use-file-for-fake-audio-capture=${HEARD}%noloop`,
];
/** What the fake camera shows, again and again, from the first time that it is opened. */
const SEEN = join(scratchFolder(), 'camera.mjpeg');
const FLAGS_OF: Record<Kind, string[]> = {
  plain: FLAGS,
  hearing: [...FLAGS, ...MICROPHONE],
  seeing: [...FLAGS, ...MICROPHONE, `--use-file-for-fake-video-capture=${SEEN}`],
};
/** How long a page may take to close, ms. */
const CLOSING = 30_000;
type Kind = 'plain' | 'hearing' | 'seeing';

/** How a browser is opened. */
export interface BrowserOptions {
  width?: number;
  height?: number;
  calm?: boolean; // the visitor wants little motion: the head does not sway
  microphone?: string; // WAV that plays as the microphone, once
  camera?: string; // Motion JPEG that is seen as the camera, the same in all tests of a file; with a microphone
  hertz?: 30 | 60; // how often the screen is refreshed; each further picture takes the processor from what is tested
}

/** Chromium without and with devices; each process of tests starts them once, they end with it. */
const running = new Map<Kind, Promise<Chromium>>();

function start(kind: Kind): Promise<Chromium> {
  return chromium.launch({
    executablePath: process.env.CHROMIUM ?? '/usr/bin/chromium',
    headless: false, // the flag says it: playwright's own switch picks another build
    args: FLAGS_OF[kind],
  });
}

/** Makes a screen of 60 Hz one of 30 Hz. */
function halveRefreshRate(): void {
  const request = requestAnimationFrame.bind(window);
  const cancel = cancelAnimationFrame.bind(window);
  const due = new Map<number, number>(); // what the page asked for, and what the browser was asked for
  let count = 0;
  window.requestAnimationFrame = (draw) => {
    const id = ++count;
    const shown = (now: number) => {
      due.delete(id);
      draw(now);
    };
    due.set(id, request(() => due.set(id, request(shown))));
    return id;
  };
  window.cancelAnimationFrame = (id) => {
    cancel(due.get(id) ?? 0);
    due.delete(id);
  };
}

/** A visitor's browser, software-rendered, with one page; nobody else's cookies, cache or permissions. */
export class Browser {
  readonly context: BrowserContext;
  readonly page: Page;
  private readonly kind: Kind;

  private constructor(kind: Kind, context: BrowserContext, page: Page) {
    this.kind = kind;
    this.context = context;
    this.page = page;
    context.setDefaultTimeout(PATIENCE);
    page.on('console', (message) => {
      if (message.type() === 'error' && !message.text().includes('WebSocket')) console.error('page:', message.text());
    });
    page.on('pageerror', (error) => console.error('page:', error));
  }

  static async launch(options: BrowserOptions = {}): Promise<Browser> {
    const { width = 320, height = 240, calm = false, microphone, camera, hertz = 30 } = options;
    if (microphone) copyFileSync(microphone, HEARD);
    if (camera) copyFileSync(camera, SEEN);
    const kind = camera ? 'seeing' : microphone ? 'hearing' : 'plain';
    if (!running.has(kind)) running.set(kind, start(kind));
    const context = await (await running.get(kind)!).newContext({
      viewport: { width, height },
      deviceScaleFactor: 1,
      reducedMotion: calm ? 'reduce' : 'no-preference',
    });
    if (hertz === 30) await context.addInitScript(halveRefreshRate);
    return new Browser(kind, context, await context.newPage());
  }

  /**
   * Opens the page and waits until the avatar is on stage.
   *
   * @param adapts whether the quality of pictures follows their rate, as for visitors; else it is the best
   */
  async open(url: string, adapts = false): Promise<Page> {
    await this.page.goto(url);
    await this.page.waitForFunction(() => window.ico3d !== undefined);
    if (!adapts) await this.page.evaluate(() => window.ico3d!.stage.holdQuality(0)); // software rendering is slow
    return this.page;
  }

  /** Closes the page; a Chromium that does not answer is ended, for by now everything has been judged. */
  async close(): Promise<void> {
    const closed = this.context.close().then(() => true);
    if (await Promise.race([closed, sleep(CLOSING, false, { ref: false })])) return;
    console.error(`Chromium did not close a page within ${CLOSING / 1000} s and is ended`);
    running.delete(this.kind); // the next of its kind is a new one
    await this.context.browser()!.close(); // by force, where asking does not help
  }
}
