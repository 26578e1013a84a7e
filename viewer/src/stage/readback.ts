import { floatFromHalf } from '../protocol.ts';
import type { Stage } from './stage.ts';

const WORDS = 4; // uint32 per texel
const WIDTH = 2048; // Spark's texture width

/**
 * Reads back what the GPU made of the head: r, g, b, opacity of each Gaussian, (N,4).
 * For tests: it stalls the GPU.
 */
export function readAttributes(stage: Stage): Float32Array {
  const { spark, renderer, head } = stage;
  const target = spark.display.target!;
  const rows = Math.ceil(head.numSplats / WIDTH);
  const texels = [0, 1].map((texture) => {
    const out = new Uint32Array(WORDS * WIDTH * rows);
    renderer.readRenderTargetPixels(target, 0, 0, WIDTH, rows, out, undefined, texture);
    return out;
  });
  return unpack(texels[0]!, texels[1]!, head.numSplats);
}

/** Spark's extended splats: (x, y, z, half2(alpha, –)), (half2(r, g), half2(b, –), –, –). */
function unpack(first: Uint32Array, second: Uint32Array, count: number): Float32Array {
  const low = (word: number) => floatFromHalf(word & 0xffff);
  const out = new Float32Array(4 * count);
  for (let i = 0; i < count; i++) {
    const rg = second[WORDS * i]!;
    out.set([low(rg), floatFromHalf(rg >>> 16), low(second[WORDS * i + 1]!), low(first[WORDS * i + 3]!)], 4 * i);
  }
  return out;
}
