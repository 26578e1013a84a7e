import { join } from 'node:path';
import type { Page } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, inject, test } from 'vitest';
import { Browser } from '../../support/browser/browser.ts';
import { refreshed } from '../../support/browser/drawing.ts';
import { overHead } from '../../support/browser/head.ts';
import { drawnBy } from '../../support/browser/path.ts';
import { keepCaptions } from '../../support/browser/talk.ts';
import { VIEWS } from '../../src/stage/camera/framing.ts';
import type { ConversationView } from '../../src/talk/conversation.ts';
import texts from '../../src/words/texts.json' with { type: 'json' };

const AROUND = 'header button, #name, #state, header .way-back, main > *';
const LONG = 'Words that fill a line, and then another one, and more of them. '.repeat(8);
const STATES = Object.entries(texts).flatMap(([key, text]) => (key.startsWith('state.') ? Object.values(text) : []));
const NOTICE = 'Das Mikrofon ist für diese Seite gesperrt: Erlauben Sie es in der Adressleiste, oder tippen Sie.';
const SIZES = [
  [844, 390],
  [667, 375],
  [800, 450],
  [844, 330], // with the bars of a browser
  [844, 200], // with a keyboard
  [390, 844],
  [352, 516], // floats on another page
  [320, 480], // in another page
  [1440, 900],
  [1280, 800],
] as const;

declare global {
  interface Window {
    /** Which words of the long sentence are seen while each is heard, by the room that the answer has. */
    pages?: Record<string, boolean[][]>;
  }
}

const { demoUrl } = inject('shared');

describe.skipIf(!demoUrl)('what is around the picture of the packaged demo', () => {
  let browser: Browser;
  let page: Page;

  /** She answers at length, on a page of many letters. */
  beforeAll(async () => {
    browser = await Browser.launch({ width: 844, height: 390, calm: true });
    ({ page } = browser);
    await page.addInitScript(() => {
      const xr = Object.assign(new EventTarget(), { offered: false, isSessionSupported: () => Promise.resolve(xr.offered) });
      Object.defineProperty(navigator, 'xr', { value: xr });
      localStorage.setItem('ico3d-language', 'de');
    });
    await browser.open(drawnBy('soft', demoUrl!));
    await page.waitForSelector('#captions:visible');
    await page.waitForFunction(() => document.body.dataset.state === 'idle' && !window.ico3d!.conversation!.player.heard());
    await keepCaptions(page);
    await page.evaluate((text) => {
      document.getElementById('question')!.textContent = text.slice(0, 60);
      document.querySelector('#answer span')!.textContent = text;
      document.getElementById('stop')!.classList.remove('gone');
    }, LONG);
  });

  afterAll(() => browser?.close());

  /** Puts what is seen into the folder `$PICTURES`, where it is set. */
  async function keepPicture(name: string): Promise<void> {
    if (!process.env.PICTURES) return;
    await page.evaluate(() => window.ico3d!.stage.still());
    await page.screenshot({ path: join(process.env.PICTURES, name) });
  }

  /** Gives the window a size, and waits until the picture has it. */
  async function sized(width: number, height: number): Promise<void> {
    await page.setViewportSize({ width, height });
    await page.waitForFunction((size) => window.ico3d!.stage.painter.pixels.join() === size, [width, height].join());
    await refreshed(page);
  }

  /** Says how the talk stands in the words, of all languages, that take most room. */
  function writeLongestState(): Promise<void> {
    return page.evaluate((texts) => {
      const state = document.getElementById('state')!;
      const room = (text: string) => {
        state.textContent = text;
        const { width, height } = state.getBoundingClientRect();
        return width * height;
      };
      state.textContent = texts.reduce((longest, text) => (room(text) > room(longest) ? text : longest));
    }, STATES);
  }

  /** From now on the device offers VR and AR, or neither. */
  async function offerHeadsets(offered: boolean): Promise<void> {
    await page.evaluate((offered) => Object.assign(navigator.xr!, { offered }).dispatchEvent(new Event('devicechange')), offered);
    await page.waitForFunction((count) => document.querySelectorAll('.xr button').length === count, offered ? 2 : 0);
  }

  describe.each(SIZES.flatMap((size) => [false, true].map((headsets) => [...size, headsets] as const)))('of %i × %i, headsets: %s', (width, height, headsets) => {
    beforeAll(async () => {
      await offerHeadsets(headsets); // before: what changes later than a second after the size leaves her where she is
      await sized(width, height);
      await writeLongestState();
    });

    test.each(VIEWS.flatMap((view) => ['', 'large'].map((size) => [view, size] as const)))('lies over neither face nor hair in the view %s (captions: %s)', async (view, size) => {
      await page.evaluate((size) => void (document.documentElement.dataset.captionsSize = size), size);
      await refreshed(page);
      await page.evaluate((view) => window.ico3d!.stage.orbit.show(view), view);
      const { head, over } = await overHead(page, AROUND);
      await keepPicture(`overlays-${width}x${height}-${view}${headsets ? '-xr' : ''}${size && '-large'}.png`);
      await page.evaluate(() => delete document.documentElement.dataset.captionsSize);
      expect(head).toBeGreaterThan(height > 256 ? 300 : 100);
      expect(over).toEqual([]);
    });

    test.each(width > height ? ['', 'large'] : [''])('does not cover one another, and is all in the picture (captions: %s)', async (size) => {
      await page.evaluate((size) => void (document.documentElement.dataset.captionsSize = size), size);
      await refreshed(page);
      const boxes = await page.$$eval('header button, #name, #state, #captions, #stop, #composer', (parts) =>
        parts.map((part) => ({ name: part.id || (part as HTMLElement).title, ...(part.getBoundingClientRect().toJSON() as DOMRect) })).filter(({ width }) => width > 0),
      );
      await page.evaluate(() => delete document.documentElement.dataset.captionsSize);
      const views = height > 256 ? VIEWS.length : 0; // over a keyboard there is no room for their buttons
      expect(boxes.length).toBe(10 + views + (headsets ? 2 : 0));
      for (const [i, a] of boxes.entries()) {
        expect.soft(a.left >= 0 && a.top >= 0 && a.right <= width && a.bottom <= height, a.name).toBe(true);
        for (const b of boxes.slice(i + 1)) {
          expect.soft(a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom, `${a.name} and ${b.name}`).toBe(false);
        }
      }
    });

    test('shows what was asked, and as much of the answer as there is room for', async () => {
      const { asked, lines } = await page.evaluate(() => {
        const answer = document.getElementById('answer')!;
        return { asked: document.getElementById('question')!.clientHeight, lines: answer.clientHeight / parseFloat(getComputedStyle(answer).lineHeight) };
      });
      if (width > 320) expect(asked).toBeGreaterThan(10);
      expect(lines).toBeGreaterThan(height < 256 ? 1.9 : width === 667 || width === 320 ? 2.9 : 3.9);
      expect(Math.abs(lines - Math.round(lines))).toBeLessThan(0.05);
    });

    test.each(['', 'large'])('goes through a long sentence by pages, each of which is seen as a whole (captions: %s)', async (size) => {
      const pages = await page.evaluate(async ([text, size]) => {
        document.documentElement.dataset.captionsSize = size;
        const answer = document.getElementById('answer')!;
        const view = (window.ico3d!.conversation as unknown as { view: ConversationView }).view;
        const ends = [...text.matchAll(/\S+\s*/g)].map(({ index, 0: word }) => [index, index + word.length] as const);
        const range = document.createRange(); // one for all: each that there is makes every change of the words slower
        const seenIn = (node: Node) => {
          if (getComputedStyle(node.parentElement!).visibility !== 'visible') return () => false;
          const place = answer.getBoundingClientRect();
          return (from: number, to: number) => {
            range.setStart(node, from);
            range.setEnd(node, to);
            const word = range.getBoundingClientRect();
            return word.top >= place.top - 3 && word.bottom <= place.bottom + 3;
          };
        };
        const { width, height } = answer.getBoundingClientRect();
        const room = [width, height, getComputedStyle(answer).fontSize].join();
        const pages = ((window.pages ??= {})[room] ??= []);
        for (const [, heard] of pages.length > 0 ? [] : ends) {
          view.heard({ utterance: 1e6, first: 0, text, heard });
          await null; // until the page has turned
          const [isSaid, isNext] = [...answer.children].map(({ firstChild }) => firstChild && seenIn(firstChild));
          pages.push(ends.map(([from, to]) => (to <= heard ? isSaid!(from, to - 1) : isNext!(from - heard, to - heard - 1))));
        }
        delete document.documentElement.dataset.captionsSize;
        return pages;
      }, [LONG.trim(), size] as const);
      for (const [i, seen] of pages.entries()) expect.soft(seen[i], `word ${i} while it is heard`).toBe(true);
      const counts = pages.map((_, i) => pages.filter((seen) => seen[i]).length).slice(0, -13); // how often a word is seen
      expect(Math.min(...counts)).toBeGreaterThan(2); // more than the moment in which it is said
    });

    describe.runIf(height < 480).each([
      ['a notice', '#notices p'],
      ['what asks the visitor', '#memory-ask'],
      ['that the sound was interrupted', '#silenced'],
    ])('%s', (_, what) => {
      beforeAll(async () => {
        await page.evaluate(([what, text]) => {
          if (what === '#notices p') document.getElementById('notices')!.append(Object.assign(document.createElement('p'), { textContent: text }));
          else document.querySelector<HTMLElement>(what)!.hidden = false;
        }, [what, NOTICE] as const);
        await refreshed(page);
      });

      afterAll(() =>
        page.evaluate((what) => {
          document.getElementById('notices')!.replaceChildren();
          if (what !== '#notices p') document.querySelector<HTMLElement>(what)!.hidden = true;
        }, what),
      );

      test.each(VIEWS)('is beside her in the view %s, over nothing else', async (view) => {
        await page.evaluate((view) => window.ico3d!.stage.orbit.show(view), view);
        const { over } = await overHead(page, what);
        await keepPicture(`${what.slice(1, 7)}-${width}x${height}-${view}${headsets ? '-xr' : ''}.png`);
        const { top, covered } = await page.evaluate((what) => {
          const { left, top, right, bottom } = document.querySelector(what)!.getBoundingClientRect();
          const others = document.querySelectorAll<HTMLElement>('#captions, #stop, #composer, #name, #state, header button');
          const isUnder = (other: DOMRect) => other.width > 0 && left < other.right && other.left < right && top < other.bottom && other.top < bottom;
          return { top, covered: [...others].filter((other) => isUnder(other.getBoundingClientRect())).map(({ id, title }) => id || title) };
        }, what);
        expect([over, covered]).toEqual([[], []]);
        expect(top).toBeGreaterThanOrEqual(0);
      });
    });
  });

  describe.each(['light', 'dark'])('in the %s', (theme) => {
    beforeAll(async () => {
      if ((await page.evaluate(() => document.body.dataset.theme)) !== theme) await page.click('.theme');
      await page.evaluate(() => window.ico3d!.stage.orbit.show('half'));
      await sized(390, 844);
    });

    test('the note under the text box is read on her clothes, too', async () => {
      const contrast = await page.evaluate(async () => {
        const note = document.getElementById('stand-ins')!;
        const numbers = (colour: string) => colour.match(/[\d.]+/g)!.map(Number);
        const luminance = (rgb: readonly number[]) =>
          [0.2126, 0.7152, 0.0722].reduce((sum, share, c) => sum + share * (rgb[c]! <= 10 ? rgb[c]! / 255 / 12.92 : ((rgb[c]! / 255 + 0.055) / 1.055) ** 2.4), 0);
        const { color, backgroundColor } = getComputedStyle(note);
        const [red, green, blue, veil = 1] = numbers(backgroundColor);
        const ink = luminance(numbers(color));
        await window.ico3d!.stage.still();
        const canvas = document.querySelector<HTMLCanvasElement>('#stage')!;
        const { left, top, width, height } = note.getBoundingClientRect();
        const { data } = canvas.getContext('2d')!.getImageData(left, top, width, height);
        let worst = Infinity;
        for (let i = 0; i < data.length; i += 4) {
          const behind = luminance([red!, green!, blue!].map((value, c) => veil * value + (1 - veil) * data[i + c]!));
          worst = Math.min(worst, (Math.max(ink, behind) + 0.05) / (Math.min(ink, behind) + 0.05));
        }
        return worst;
      });
      await keepPicture(`note-${theme}.png`);
      expect(contrast).toBeGreaterThanOrEqual(4.5);
    });
  });
});
