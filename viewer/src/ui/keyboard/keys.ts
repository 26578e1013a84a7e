import { VIEWS } from '../../stage/camera/framing.ts';
import { RETURNING, TURNING, ZOOMING } from '../../stage/camera/keys.ts';

/** The keys for each thing that keys do. Whatever hears keys asks here, and the help tells what is here. */
export const KEYS = {
  talk: [' '],
  write: ['/'],
  escape: ['Escape'],
  mute: ['m'],
  transcript: ['t'],
  view: VIEWS.map((_, i) => String(i + 1)),
  help: ['?'],
  turn: TURNING,
  zoom: ZOOMING,
  home: RETURNING,
  play: [' '],
  frame: ['ArrowLeft', 'ArrowRight'],
} as const satisfies Record<string, readonly string[]>;

export type Deed = keyof typeof KEYS;

/** Whether a key is one for something; letters are, small and capital. */
export function isFor(deed: Deed, { key }: KeyboardEvent): boolean {
  return (KEYS[deed] as readonly string[]).includes(key.length === 1 ? key.toLowerCase() : key);
}

/** Whether a key is typed into a text, or is meant for the browser. */
export function isForOthers(event: KeyboardEvent): boolean {
  return isForBrowser(event) || isInText(event);
}

/** The same of a key with which no text begins: where nothing has been typed yet, it is not for a text. */
export function isForTexts(event: KeyboardEvent): boolean {
  const { id, value } = event.composedPath()[0] as HTMLInputElement;
  return isForBrowser(event) || (isInText(event) && !(id === 'text' && value === ''));
}

function isForBrowser({ ctrlKey, metaKey, altKey }: KeyboardEvent): boolean {
  return ctrlKey || metaKey || altKey;
}

function isInText(event: KeyboardEvent): boolean {
  const target = event.composedPath()[0] as Element;
  return target.closest?.('textarea, select, [contenteditable], input:not([type=radio], [type=range], [type=checkbox])') != null;
}
