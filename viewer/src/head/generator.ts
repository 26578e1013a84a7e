import { dyno, SplatGenerator, SplatTransformer } from '@sparkjsdev/spark';
import * as THREE from 'three';
import type { BakedHead } from '../bundle/baked-head.ts';
import { splatGenerator, type Generator } from '../splat-shader.ts';
import { coefficients } from './coefficients.ts';

const WIDTH = 1024; // texels per row: one texel is one Gaussian
const REST_LAYERS = 4; // centre + basis scale, quaternion, scales, mean logits
const PACKED = 4; // basis vectors in a texel: a fetch costs far more than taking them apart

/**
 * The head as a Spark generator: a shader that makes Gaussian i from textures and K coefficients.
 *
 * Its capacity never changes, and no opacity is ever 0 (sigmoid), so Spark keeps its sort order
 * from one expression to the next instead of holding the old picture until it has sorted anew.
 */
export class HeadGenerator extends SplatGenerator {
  private readonly network: BakedHead['network'];
  private readonly values: Float32Array; // (K,) uniform, shared with the GPU program

  constructor(head: BakedHead) {
    const values = new Float32Array(head.rank);
    const transformer = new SplatTransformer();
    super({
      numSplats: head.count,
      generator: makeGenerator(head, values, transformer),
      // Without this the program would place the head at infinity.
      update: () => {
        if (transformer.update(this)) this.updateVersion();
      },
    });
    this.network = head.network;
    this.values = values;
  }

  /** Coefficients of the expression shown, (K,). */
  get shown(): Float32Array {
    return this.values;
  }

  /** Shows an expression (B,) from the next frame on. */
  express(expression: Float32Array): void {
    coefficients(this.network, expression, this.values);
    this.updateVersion();
  }
}

function makeGenerator(head: BakedHead, values: Float32Array, transformer: SplatTransformer): Generator {
  const uniforms = {
    headRest: { value: restTexture(head) },
    headBasis: { value: basisTexture(head) },
    headCoefficients: { value: values },
  };
  return splatGenerator(
    { declarations: declarations(head.rank), uniforms, statements: (index, gsplat) => statements(head.rank, index, gsplat) },
    transformer,
  );
}

function declarations(rank: number): string {
  return dyno.unindent(`
    uniform sampler2DArray headRest;
    uniform usampler2DArray headBasis;
    uniform float headCoefficients[${rank}];
    vec4 headVector(uvec4 four, int left) {
      return vec4(ivec4(four << left) >> 24);
    }
  `);
}

/** logits = mean + scale · Σ c·U; rgb, opacity = sigmoid(logits). */
function statements(rank: number, index: string, gsplat: string): string[] {
  const fetches = Array.from(
    { length: Math.ceil(rank / PACKED) },
    (_, i) => `uvec4 u${i} = texelFetch(headBasis, ivec3(texel, ${i}), 0);`,
  );
  const terms = Array.from(
    { length: rank },
    (_, k) => `headCoefficients[${k}] * headVector(u${Math.floor(k / PACKED)}, ${24 - 8 * (k % PACKED)})`,
  );
  return dyno.unindentLines(`
    ivec2 texel = ivec2(${index} % ${WIDTH}, ${index} / ${WIDTH});
    vec4 centreAndScale = texelFetch(headRest, ivec3(texel, 0), 0);
    ${fetches.join(' ')}
    vec4 blend = ${terms.join(' + ')};
    vec4 logits = texelFetch(headRest, ivec3(texel, 3), 0) + centreAndScale.w * blend;
    ${gsplat}.flags = GSPLAT_FLAG_ACTIVE;
    ${gsplat}.index = ${index};
    ${gsplat}.center = centreAndScale.xyz;
    ${gsplat}.quaternion = texelFetch(headRest, ivec3(texel, 1), 0);
    ${gsplat}.scales = texelFetch(headRest, ivec3(texel, 2), 0).xyz;
    ${gsplat}.rgba = 1.0 / (1.0 + exp(-logits));
  `);
}

function restTexture(head: BakedHead): THREE.DataArrayTexture {
  const { count: n, means, quats, scales, meanLogits, basisScale } = head;
  const rows = Math.ceil(n / WIDTH);
  const layer = 4 * WIDTH * rows;
  const texels = new Float32Array(REST_LAYERS * layer);
  for (let i = 0; i < n; i++) {
    const [w, x, y, z] = quats.subarray(4 * i);
    const s = scales.subarray(3 * i);
    texels.set([means[3 * i]!, means[3 * i + 1]!, means[3 * i + 2]!, basisScale[i]!], 4 * i);
    texels.set(normalised(x!, y!, z!, w!), layer + 4 * i); // Spark: xyzw
    texels.set([Math.exp(s[0]!), Math.exp(s[1]!), Math.exp(s[2]!), 0], 2 * layer + 4 * i);
    texels.set(meanLogits.subarray(4 * i, 4 * i + 4), 3 * layer + 4 * i);
  }
  const texture = new THREE.DataArrayTexture(texels, WIDTH, rows, REST_LAYERS);
  texture.type = THREE.FloatType;
  texture.internalFormat = 'RGBA32F';
  texture.needsUpdate = true;
  return texture;
}

function normalised(...q: [number, number, number, number]): number[] {
  const length = Math.hypot(...q);
  return q.map((value) => value / length);
}

/** Layers of texels (r, g, b, opacity), each number with a byte of four basis vectors. */
function basisTexture(head: BakedHead): THREE.DataArrayTexture {
  const { count: n, rank, basis } = head;
  const rows = Math.ceil(n / WIDTH);
  const layer = 4 * WIDTH * rows;
  const layers = Math.ceil(rank / PACKED);
  const texels = new Uint32Array(layers * layer);
  const bytes = new Int8Array(texels.buffer); // little-endian, as every device with WebGL is
  for (let k = 0; k < rank; k++) {
    const begin = PACKED * Math.floor(k / PACKED) * layer + (k % PACKED);
    for (let i = 0; i < 4 * n; i++) bytes[begin + PACKED * i] = basis[4 * n * k + i]!;
  }
  const texture = new THREE.DataArrayTexture(texels, WIDTH, rows, layers);
  texture.format = THREE.RGBAIntegerFormat;
  texture.type = THREE.UnsignedIntType;
  texture.internalFormat = 'RGBA32UI';
  texture.needsUpdate = true;
  return texture;
}
