/** Half precision numbers as single ones; `Float32Array.from` would make a list of them first, eleven times as large. */
export function floatsFromHalves(words: Uint16Array): Float32Array<ArrayBuffer> {
  const values = new Float32Array(words.length);
  for (let i = 0; i < words.length; i++) values[i] = floatFromHalf(words[i]!);
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
