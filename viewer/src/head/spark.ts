import { dyno } from '@sparkjsdev/spark';
import * as THREE from 'three';
import type { HeadRows } from '../bundle/baked-head.ts';
import { SparkTwin } from '../gaussians/spark.ts';
import { copy } from '../numbers.ts';
import type { HeadGenerator } from './generator.ts';
import { MOTION_SIZE } from './shoulders.ts';
import type { ShownRows } from './soft.ts';

const WIDTH = 1024; // texels per row: one texel is one Gaussian
const REST_LAYERS = 4; // centre + basis scale, quaternion, scales + share of the shoulders' motion, mean logits
const PACKED = 4; // basis vectors or displacements in a texel: a fetch costs far more than taking them apart

/** The head as Spark draws it: a shader makes Gaussian i from textures and K coefficients; no opacity is ever 0 (sigmoid). */
export class SparkHead extends SparkTwin {
  constructor(head: HeadGenerator) {
    const [first] = head.parts;
    const { rank, moves, count } = first!;
    const texels = makeTexels(head.numSplats, rank, moves);
    const grown = { value: head.grown };
    const wide = { value: head.wide };
    let filled = 0; // parts
    let gaussians = 0;
    const follow = () => {
      grown.value = head.grown;
      wide.value = head.wide;
      for (const part of head.parts.slice(filled)) {
        fill(texels, part, gaussians);
        gaussians += part.count;
        filled++;
      }
    };
    const uniforms = {
      headRest: { value: texels.rest },
      headBasis: { value: texels.basis },
      headCoefficients: { value: head.shown },
      headSteps: { value: moves ? head.steps : new Float32Array(1) },
      headFirst: { value: count },
      headGrown: grown,
      headWide: wide,
      headBend: { value: head.bent },
    };
    super(head, { declarations: declarations(rank, moves), uniforms, statements: (index, gsplat) => statements(rank, moves, index, gsplat) }, follow);
  }
}

function declarations(rank: number, moves: number): string {
  return dyno.unindent(`
    uniform sampler2DArray headRest;
    uniform usampler2DArray headBasis;
    uniform float headCoefficients[${rank}];
    uniform float headSteps[${Math.max(moves, 1)}];
    uniform int headFirst;
    uniform float headGrown;
    uniform float headWide;
    uniform float headBend[${MOTION_SIZE}];
    vec4 headTurned(vec4 a, vec4 b) {
      return vec4(a.w * b.xyz + b.w * a.xyz + cross(a.xyz, b.xyz), a.w * b.w - dot(a.xyz, b.xyz));
    }
    vec4 headVector(uvec4 four, int left) {
      return vec4(ivec4(four << left) >> 24);
    }
  `);
}

/** logits = mean + scale · Σ c·U; rgb, opacity = sigmoid(logits); centre = mean + Σ d·D. */
function statements(rank: number, moves: number, index: string, gsplat: string): string[] {
  const fetches = Array.from(
    { length: layersOf(rank) + layersOf(moves) },
    (_, i) => `uvec4 u${i} = texelFetch(headBasis, ivec3(texel, ${i}), 0);`,
  );
  const sum = (factors: string, count: number, layer: number) =>
    Array.from(
      { length: count },
      (_, k) => `${factors}[${k}] * headVector(u${layer + Math.floor(k / PACKED)}, ${24 - 8 * (k % PACKED)})`,
    ).join(' + ');
  return dyno.unindentLines(`
    ${gsplat}.flags = 0u;
    ${gsplat}.index = ${index};
    float grown = ${index} < headFirst ? 1.0 : headGrown;
    if (grown > 0.0) {
      ivec2 texel = ivec2(${index} % ${WIDTH}, ${index} / ${WIDTH});
      vec4 centreAndScale = texelFetch(headRest, ivec3(texel, 0), 0);
      ${fetches.join(' ')}
      vec4 blend = ${sum('headCoefficients', rank, 0)};
      vec4 logits = texelFetch(headRest, ivec3(texel, 3), 0) + centreAndScale.w * blend;
      ${gsplat}.flags = GSPLAT_FLAG_ACTIVE;
      ${gsplat}.center = centreAndScale.xyz${moves ? ` + (${sum('headSteps', moves, layersOf(rank))}).xyz` : ''};
      ${gsplat}.quaternion = texelFetch(headRest, ivec3(texel, 1), 0);
      vec4 scalesAndShare = texelFetch(headRest, ivec3(texel, 2), 0);
      ${gsplat}.scales = scalesAndShare.xyz * (${index} < headFirst ? headWide : 1.0);
      if (scalesAndShare.w > 0.0) {
        vec4 bend = vec4(headBend[1], headBend[2], headBend[3], headBend[0]);
        vec3 across = cross(bend.xyz, ${gsplat}.center) + bend.w * ${gsplat}.center;
        vec3 shift = 2.0 * cross(bend.xyz, across) + vec3(headBend[4], headBend[5], headBend[6]);
        ${gsplat}.center += scalesAndShare.w * shift;
        ${gsplat}.quaternion = normalize(headTurned(mix(vec4(0.0, 0.0, 0.0, 1.0), bend, scalesAndShare.w), ${gsplat}.quaternion));
      }
      ${gsplat}.rgba = 1.0 / (1.0 + exp(-logits));
      ${gsplat}.rgba.a *= grown;
    }
  `);
}

/** Textures of a fixed number of Gaussians, one texel each. */
interface Texels {
  rest: THREE.DataArrayTexture;
  basis: THREE.DataArrayTexture; // r, g, b, opacity, each number with a byte of four basis vectors; then x, y, z of four displacements
}

function layersOf(vectors: number): number {
  return Math.ceil(vectors / PACKED);
}

function makeTexels(capacity: number, rank: number, moves: number): Texels {
  const rows = Math.ceil(capacity / WIDTH);
  const layer = 4 * WIDTH * rows;
  const layers = layersOf(rank) + layersOf(moves);
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
function fill({ rest, basis }: Texels, rows: ShownRows, begin: number): void {
  fillRest(rest.image.data as Float32Array, rest.image.height, rows, begin);
  fillBasis(basis.image.data as Uint32Array, basis.image.height, rows, begin);
  rest.needsUpdate = basis.needsUpdate = true;
}

function fillRest(texels: Float32Array, height: number, rows: ShownRows, begin: number): void {
  const { count, means, quats, scales, meanLogits, basisScale, share } = rows;
  const layer = 4 * WIDTH * height;
  for (let i = 0; i < count; i++) {
    const at = 4 * (begin + i);
    copy(means, 3 * i, 3, texels, at);
    texels[at + 3] = basisScale[i]!;
    const length = Math.hypot(quats[4 * i]!, quats[4 * i + 1]!, quats[4 * i + 2]!, quats[4 * i + 3]!);
    for (let k = 0; k < 4; k++) texels[layer + at + k] = quats[4 * i + ((k + 1) & 3)]! / length; // Spark: xyzw
    for (let k = 0; k < 3; k++) texels[2 * layer + at + k] = Math.exp(scales[3 * i + k]!);
    texels[2 * layer + at + 3] = share[i]! / 255;
    copy(meanLogits, 4 * i, 4, texels, 3 * layer + at);
  }
}

function fillBasis(texels: Uint32Array, height: number, { count, rank, moves, basis, displacements }: HeadRows, begin: number): void {
  const layer = 4 * WIDTH * height;
  const bytes = new Int8Array(texels.buffer); // little-endian, as every device with WebGL is
  for (let k = 0; k < rank; k++) {
    const first = PACKED * (Math.floor(k / PACKED) * layer + 4 * begin) + (k % PACKED);
    for (let i = 0; i < 4 * count; i++) bytes[first + PACKED * i] = basis[4 * count * k + i]!;
  }
  for (let m = 0; m < moves; m++) {
    const first = PACKED * ((layersOf(rank) + Math.floor(m / PACKED)) * layer + 4 * begin) + (m % PACKED);
    for (let i = 0; i < 3 * count; i++) bytes[first + PACKED * (i + Math.floor(i / 3))] = displacements[3 * count * m + i]!;
  }
}
