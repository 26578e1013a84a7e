import { remember, remembered } from '../remembered.ts';
import type { Path } from '../soft/contract.ts';
import { seeGraphics, type Graphics } from '../soft/graphics.ts';
import { say, type Message } from '../words/text.ts';

const KEY = 'draw';
const PATHS: readonly string[] = ['webgl', 'soft'] satisfies Path[];

/** What a visitor wants to draw; `auto` leaves it to the page. */
export type Wish = Path | 'auto';

/** What draws, and why it does. */
export interface Choice {
  path: Path;
  why: Message;
}

/**
 * What is wanted at first.
 *
 * @param given by the page's address, or the page around an avatar; else it is what the visitor chose before
 */
export function wishOf(given: string | null = null): Wish {
  const wish = [given, remembered(KEY)].find((one) => one !== null && PATHS.includes(one));
  return given === 'auto' ? given : ((wish as Path | undefined) ?? 'auto');
}

/** Keeps a wish for the next visit. */
export function rememberWish(wish: Wish): void {
  remember(KEY, wish);
}

/**
 * Which path draws: the wanted one, or WebGL where a graphics card draws it. The processor draws
 * whatever is wanted where there is no WebGL 2.
 */
export function choosePath(wish: Wish, see: () => Graphics | null = seeGraphics): Choice {
  if (wish === 'soft') return { path: 'soft', why: say('drawn.chosen.soft') };
  const graphics = see();
  if (!graphics) return { path: 'soft', why: say('drawn.none') };
  const { name } = graphics;
  if (wish === 'webgl') return { path: 'webgl', why: say('drawn.chosen.webgl', { name }) };
  return graphics.software ? { path: 'soft', why: say('drawn.software', { name }) } : { path: 'webgl', why: say('drawn.card', { name }) };
}
