/** Numbers in [0, 1) that are the same each time: a linear congruential generator. */
export function random(seed: number): () => number {
  let state = seed;
  return () => {
    state = (Math.imul(1664525, state) + 1013904223) >>> 0;
    return state / 2 ** 32;
  };
}
