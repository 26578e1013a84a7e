const RATIOS = [1, 0.618034, 0.414214]; // frequencies of the sines, relative to the first
const WEIGHTS = [0.5, 0.3, 0.2]; // amplitudes of the sines

/** A hash from 0 to 2³² - 1 of whole numbers below 2³², whose order matters; as in `ico3d/motion/noise.py`. */
export function scrambled(...numbers: number[]): number {
  let state = 0x9e3779b9;
  for (const number of numbers) {
    state ^= number;
    state = Math.imul(state ^ (state >>> 16), 0x7feb352d);
    state = Math.imul(state ^ (state >>> 15), 0x846ca68b);
    state ^= state >>> 16;
  }
  return state >>> 0;
}

/** A random number 0 ≤ x < 1 from the hash of whole numbers. */
export function chance(...numbers: number[]): number {
  return scrambled(...numbers) / 2 ** 32;
}

/**
 * A slow, smooth value between -1 and 1 that does not repeat over time.
 *
 * @param time s
 * @param period period of the quickest sine, s; it varies by a tenth with seed and channel
 * @param seed seed of the person
 * @param channel number of the movement; different movements of a person are independent
 */
export function wander(time: number, period: number, seed: number, channel: number): number {
  return RATIOS.reduce((sum, ratio, number) => {
    const phase = 2 * Math.PI * chance(seed, channel, number);
    const stretch = 0.9 + 0.2 * chance(seed, channel, number, 1);
    return sum + WEIGHTS[number]! * Math.sin(((2 * Math.PI * ratio * stretch) / period) * time + phase);
  }, 0);
}
