let halves: Float32Array | null = null; // the number of each of the 2¹⁶ words

/** Half precision numbers as single ones; `Float32Array.from` would make a list of them first, eleven times as large. */
export function floatsFromHalves(words: Uint16Array): Float32Array<ArrayBuffer> {
  halves ??= Float32Array.from({ length: 2 ** 16 }, (_, word) => floatFromHalf(word));
  const values = new Float32Array(words.length);
  for (let i = 0; i < words.length; i++) values[i] = halves[words[i]!]!;
  return values;
}

/** IEEE 754 half precision to a number. */
export function floatFromHalf(word: number): number {
  const sign = word & 0x8000 ? -1 : 1;
  const exponent = (word >> 10) & 0x1f;
  const fraction = word & 0x3ff;
  if (exponent === 0) return sign * fraction * 2 ** -24;
  if (exponent === 31) return fraction ? NaN : sign * Infinity;
  return sign * (1 + fraction / 1024) * 2 ** (exponent - 15);
}

/** Whether all are finite; `every` would make an object of each number. */
export function allFinite(values: ArrayLike<number>): boolean {
  for (let i = 0; i < values.length; i++) if (!Number.isFinite(values[i])) return false;
  return true;
}

/** Copies a few numbers, as is done for each Gaussian: a view of them would be an object of its own, of 200 bytes. */
export function copy(from: ArrayLike<number>, at: number, count: number, to: { [index: number]: number }, place: number): void {
  for (let i = 0; i < count; i++) to[place + i] = from[at + i]!;
}
