import type { Generator } from '../../gaussians/generator.ts';
import { floatFromHalf } from '../../numbers.ts';
import type { Stage } from '../stage.ts';

const WORDS = 4; // uint32 per texel
const WIDTH = 2048; // Spark's texture width

/** What the GPU made of N Gaussians. */
export interface Splats {
  centres: Float32Array; // (N,3)
  rgba: Float32Array; // (N,4)
}

/** Reads back what is drawn of a generator. For tests: it stalls the GPU. */
export function readSplats(stage: Stage, generator: Generator): Splats {
  return unpack(...readTexels(stage, generator), generator.numSplats);
}

/** Reads back what is drawn of a generator as the texels of Spark's extended splats, two for each; rows are filled up. */
export function readTexels({ spark, renderer }: Stage, generator: Generator): [Uint32Array, Uint32Array] {
  const target = spark.display.target!;
  const { base, count } = spark.display.mapping.find(({ node }) => node.parent === generator)!;
  const rows = Math.ceil(count / WIDTH);
  const read = (texture: number) => {
    const out = new Uint32Array(WORDS * WIDTH * rows);
    renderer.readRenderTargetPixels(target, 0, base / WIDTH, WIDTH, rows, out, undefined, texture);
    return out;
  };
  return [read(0), read(1)];
}

/** Spark's extended splats: (x, y, z, half2(alpha, –)), (half2(r, g), half2(b, –), –, –). */
function unpack(first: Uint32Array, second: Uint32Array, count: number): Splats {
  const low = (word: number) => floatFromHalf(word & 0xffff);
  const floats = new Float32Array(first.buffer);
  const [centres, rgba] = [new Float32Array(3 * count), new Float32Array(4 * count)];
  for (let i = 0; i < count; i++) {
    const at = WORDS * i;
    centres.set(floats.subarray(at, at + 3), 3 * i);
    const rg = second[at]!;
    rgba.set([low(rg), floatFromHalf(rg >>> 16), low(second[at + 1]!), low(first[at + 3]!)], 4 * i);
  }
  return { centres, rgba };
}
