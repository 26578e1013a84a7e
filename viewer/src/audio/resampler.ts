const ZERO_CROSSINGS = 16; // on each side of the windowed sinc
const KAISER_BETA = 8; // stop band under −80 dB
const PHASES = 256; // tabulated between two input samples

/**
 * Streaming sample-rate conversion with a Kaiser-windowed sinc, band-limited to the lower rate.
 * Feed it blocks of any size: the output is that of one long block.
 */
export class Resampler {
  private readonly step: number; // input samples per output sample
  private readonly half: number; // taps on each side, input samples
  private readonly table: Float32Array; // (PHASES + 1, 2·half)
  private history: Float32Array;
  private position: number; // of the next output sample in `history`

  constructor(from: number, to: number) {
    this.step = from / to;
    const cutoff = Math.min(1, to / from) * 0.94; // the window's own width falls below the limit
    this.half = Math.ceil(ZERO_CROSSINGS / cutoff);
    this.table = kernelTable(this.half, cutoff);
    this.history = new Float32Array(this.half - 1);
    this.position = this.half - 1;
  }

  /** The output that became computable with `block`. */
  push(block: Float32Array): Float32Array {
    const input = new Float32Array(this.history.length + block.length);
    input.set(this.history);
    input.set(block, this.history.length);
    const out: number[] = [];
    while (Math.floor(this.position) + this.half < input.length) {
      out.push(this.sample(input, this.position));
      this.position += this.step;
    }
    const used = Math.min(Math.floor(this.position) - this.half + 1, input.length);
    this.history = input.slice(used);
    this.position -= used;
    return Float32Array.from(out);
  }

  private sample(input: Float32Array, position: number): number {
    const index = Math.floor(position);
    const phase = (position - index) * PHASES;
    const row = Math.floor(phase);
    const fraction = phase - row;
    const width = 2 * this.half;
    const first = index - this.half + 1;
    let sum = 0;
    for (let i = 0; i < width; i++) {
      const low = this.table[row * width + i]!;
      const high = this.table[(row + 1) * width + i]!;
      sum += input[first + i]! * (low + (high - low) * fraction);
    }
    return sum;
  }
}

function kernelTable(half: number, cutoff: number): Float32Array {
  const width = 2 * half;
  const table = new Float32Array((PHASES + 1) * width);
  for (let row = 0; row <= PHASES; row++) {
    const taps = Array.from({ length: width }, (_, i) => kernel(i - half + 1 - row / PHASES, half, cutoff));
    const sum = taps.reduce((total, tap) => total + tap, 0);
    taps.forEach((tap, i) => (table[row * width + i] = tap / sum)); // exactly 1 for a constant
  }
  return table;
}

function kernel(x: number, half: number, cutoff: number): number {
  if (Math.abs(x) >= half) return 0;
  const angle = Math.PI * x * cutoff;
  const sinc = angle === 0 ? 1 : Math.sin(angle) / angle;
  return cutoff * sinc * (bessel(KAISER_BETA * Math.sqrt(1 - (x / half) ** 2)) / bessel(KAISER_BETA));
}

/** Modified Bessel function of order 0. */
function bessel(x: number): number {
  let sum = 1;
  let term = 1;
  for (let k = 1; term > 1e-12 * sum; k++) {
    term *= (x / (2 * k)) ** 2;
    sum += term;
  }
  return sum;
}

/** Samples in −1…1 as 16-bit integers, clipped. */
export function toPcm16(samples: Float32Array): Int16Array {
  return Int16Array.from(samples, (value) => Math.round(Math.max(-1, Math.min(1, value)) * 0x7fff));
}
