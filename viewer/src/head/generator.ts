import { dyno, SplatGenerator, SplatTransformer } from '@sparkjsdev/spark';
import * as THREE from 'three';
import type { BakedHead, HeadRows } from '../bundle/baked-head.ts';
import { splatGenerator, type Generator } from '../gaussians/splat-shader.ts';
import { coefficients } from './coefficients.ts';
import { SoftHead } from './soft.ts';

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
  readonly soft: SoftHead;
  private readonly network: BakedHead['network'];
  private readonly values: Float32Array; // (K,) uniform, shared with the GPU program
  private readonly texels: Texels;
  private readonly grown: { value: number }; // share of their opacity that Gaussians have which came later

  /** @param capacity number of all its Gaussians, of which `head` may have the first only */
  constructor(head: BakedHead, capacity = head.count) {
    const values = new Float32Array(head.rank);
    const grown = { value: 0 };
    const texels = makeTexels(capacity, head.rank);
    const transformer = new SplatTransformer();
    super({
      numSplats: capacity,
      generator: makeGenerator(head, texels, { values, grown }, transformer),
      // Without this the program would place the head at infinity.
      update: () => {
        if (transformer.update(this)) this.updateVersion();
      },
    });
    this.soft = new SoftHead(head, values);
    this.network = head.network;
    this.values = values;
    this.texels = texels;
    this.grown = grown;
    fill(texels, head, 0);
  }

  /** Takes the Gaussians that come after the first ones; they are not seen until `grow`. */
  complete(rest: HeadRows): void {
    fill(this.texels, rest, this.numSplats - rest.count);
    this.soft.complete(rest);
  }

  /** Shows the Gaussians that came later with a share of their opacity. */
  grow(share: number): void {
    this.grown.value = share;
    this.soft.show();
    this.updateVersion();
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

interface Moving {
  values: Float32Array;
  grown: { value: number };
}

function makeGenerator(head: BakedHead, { rest, basis }: Texels, { values, grown }: Moving, transformer: SplatTransformer): Generator {
  const uniforms = {
    headRest: { value: rest },
    headBasis: { value: basis },
    headCoefficients: { value: values },
    headFirst: { value: head.count },
    headGrown: grown,
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
    uniform int headFirst;
    uniform float headGrown;
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
    ${gsplat}.flags = 0u;
    ${gsplat}.index = ${index};
    float grown = ${index} < headFirst ? 1.0 : headGrown;
    if (grown > 0.0) {
      ivec2 texel = ivec2(${index} % ${WIDTH}, ${index} / ${WIDTH});
      vec4 centreAndScale = texelFetch(headRest, ivec3(texel, 0), 0);
      ${fetches.join(' ')}
      vec4 blend = ${terms.join(' + ')};
      vec4 logits = texelFetch(headRest, ivec3(texel, 3), 0) + centreAndScale.w * blend;
      ${gsplat}.flags = GSPLAT_FLAG_ACTIVE;
      ${gsplat}.center = centreAndScale.xyz;
      ${gsplat}.quaternion = texelFetch(headRest, ivec3(texel, 1), 0);
      ${gsplat}.scales = texelFetch(headRest, ivec3(texel, 2), 0).xyz;
      ${gsplat}.rgba = 1.0 / (1.0 + exp(-logits));
      ${gsplat}.rgba.a *= grown;
    }
  `);
}

/** Textures of a fixed number of Gaussians, one texel each. */
interface Texels {
  rest: THREE.DataArrayTexture;
  basis: THREE.DataArrayTexture; // r, g, b, opacity, each number with a byte of four basis vectors
}

function makeTexels(capacity: number, rank: number): Texels {
  const rows = Math.ceil(capacity / WIDTH);
  const layer = 4 * WIDTH * rows;
  const layers = Math.ceil(rank / PACKED);
  const rest = new THREE.DataArrayTexture(new Float32Array(REST_LAYERS * layer), WIDTH, rows, REST_LAYERS);
  rest.type = THREE.FloatType;
  rest.internalFormat = 'RGBA32F';
  const basis = new THREE.DataArrayTexture(new Uint32Array(layers * layer), WIDTH, rows, layers);
  basis.format = THREE.RGBAIntegerFormat;
  basis.type = THREE.UnsignedIntType;
  basis.internalFormat = 'RGBA32UI';
  return { rest, basis };
}

/** Writes Gaussians from number `begin` on. */
function fill({ rest, basis }: Texels, rows: HeadRows, begin: number): void {
  fillRest(rest.image.data as Float32Array, rest.image.height, rows, begin);
  fillBasis(basis.image.data as Uint32Array, basis.image.height, rows, begin);
  rest.needsUpdate = basis.needsUpdate = true;
}

function fillRest(texels: Float32Array, height: number, rows: HeadRows, begin: number): void {
  const { count, means, quats, scales, meanLogits, basisScale } = rows;
  const layer = 4 * WIDTH * height;
  for (let i = 0; i < count; i++) {
    const [w, x, y, z] = quats.subarray(4 * i);
    const s = scales.subarray(3 * i);
    const at = 4 * (begin + i);
    texels.set([means[3 * i]!, means[3 * i + 1]!, means[3 * i + 2]!, basisScale[i]!], at);
    texels.set(normalised(x!, y!, z!, w!), layer + at); // Spark: xyzw
    texels.set([Math.exp(s[0]!), Math.exp(s[1]!), Math.exp(s[2]!), 0], 2 * layer + at);
    texels.set(meanLogits.subarray(4 * i, 4 * i + 4), 3 * layer + at);
  }
}

function fillBasis(texels: Uint32Array, height: number, { count, rank, basis }: HeadRows, begin: number): void {
  const layer = 4 * WIDTH * height;
  const bytes = new Int8Array(texels.buffer); // little-endian, as every device with WebGL is
  for (let k = 0; k < rank; k++) {
    const first = PACKED * (Math.floor(k / PACKED) * layer + 4 * begin) + (k % PACKED);
    for (let i = 0; i < 4 * count; i++) bytes[first + PACKED * i] = basis[4 * count * k + i]!;
  }
}

function normalised(...q: [number, number, number, number]): number[] {
  const length = Math.hypot(...q);
  return q.map((value) => value / length);
}
