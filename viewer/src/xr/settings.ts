/** What a headset draws. */
export interface XrSettings {
  scale: number; // of the pixels along a side that the headset recommends
  foveation: number; // from 0, sharp everywhere, to 1, coarse at the edge of the sight
}

const SCALE = { usual: 0.8, least: 0.3, most: 2 }; // close to somebody, filling of pixels is what takes the time
const FOVEATION = { usual: 1, least: 0, most: 1 };

/**
 * Reads what a visitor, or the page around an avatar, wants.
 *
 * @param given the value of `xr-scale` or `xr-foveation`; null where there is none
 */
export function xrSettings(given: (name: string) => string | null): XrSettings {
  return { scale: within(given('xr-scale'), SCALE), foveation: within(given('xr-foveation'), FOVEATION) };
}

function within(text: string | null, { usual, least, most }: typeof SCALE): number {
  const value = Number(text?.trim() || NaN);
  return Number.isNaN(value) ? usual : Math.min(most, Math.max(least, value));
}
