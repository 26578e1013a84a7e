import { dyno } from '@sparkjsdev/spark';
import * as THREE from 'three';
import { SparkTwin } from '../gaussians/spark.ts';
import type { WindowGenerator } from './generator.ts';
import { coefficientTexels, type Capacity, type PackedWindow } from './packed.ts';

const LEAST_SCALE = '1e-6'; // metres

/** One slot as Spark draws it: a shader moves the Gaussians of the window in the slot, with opacity 0 while nobody may see them. */
export class SparkWindow extends SparkTwin {
  constructor(slot: WindowGenerator) {
    const { capacity, coefficients } = slot;
    const uniforms = makeUniforms(capacity, coefficients);
    let held: PackedWindow | null = null;
    const follow = () => {
      if (slot.content && slot.content !== held) {
        held = slot.content;
        replace(uniforms.bodyRest.value, held.rest);
        replace(uniforms.bodyColours.value, held.colours);
        replace(uniforms.bodyBasis.value, held.basis);
      }
      uniforms.bodyCount.value = slot.count;
      uniforms.bodyGate.value = slot.unseen ? 0 : 1;
      uniforms.bodyCoefficients.value.needsUpdate = true;
    };
    super(slot, { declarations: DECLARATIONS, uniforms, statements: (index, gsplat) => statements(capacity, index, gsplat) }, follow);
  }
}

interface Uniforms {
  [name: string]: { value: unknown };
  bodyRest: { value: THREE.DataArrayTexture };
  bodyColours: { value: THREE.DataArrayTexture };
  bodyBasis: { value: THREE.DataArrayTexture };
  bodyCoefficients: { value: THREE.DataTexture }; // one row per cluster
  bodyCount: { value: number }; // Gaussians that are drawn; 0 while asleep
  bodyGate: { value: number }; // factor of opacities: 1 if visible, else 0
}

function makeUniforms({ width, rows, clusters, ranks }: Capacity, coefficients: Float32Array): Uniforms {
  const size = ranks[0] + ranks[1] + ranks[2];
  const texels = (layers: number) => 4 * width * rows * layers;
  const array = (data: Float32Array | Uint8Array | Int16Array, layers: number) =>
    new THREE.DataArrayTexture(data, width, rows, layers);
  const rest = array(new Float32Array(texels(2)), 2);
  rest.type = THREE.FloatType;
  rest.internalFormat = 'RGBA32F';
  const colours = array(new Uint8Array(texels(1)), 1);
  colours.internalFormat = 'RGBA8';
  const basis = array(new Int16Array(texels(1 + size)), 1 + size);
  basis.format = THREE.RGBAIntegerFormat;
  basis.type = THREE.ShortType;
  basis.internalFormat = 'RGBA16I';
  const across = coefficientTexels(ranks);
  const curves = new THREE.DataTexture(coefficients, across, clusters, THREE.RGBAFormat, THREE.FloatType);
  for (const texture of [rest, colours, basis, curves]) texture.needsUpdate = true;
  return {
    bodyRest: { value: rest },
    bodyColours: { value: colours },
    bodyBasis: { value: basis },
    bodyCoefficients: { value: curves },
    bodyCount: { value: 0 },
    bodyGate: { value: 0 },
  };
}

function replace(texture: THREE.DataArrayTexture, data: Float32Array | Uint8Array | Int16Array): void {
  texture.image.data = data;
  texture.needsUpdate = true;
}

const DECLARATIONS = dyno.unindent(`
  uniform sampler2DArray bodyRest;
  uniform sampler2DArray bodyColours;
  uniform isampler2DArray bodyBasis;
  uniform sampler2D bodyCoefficients;
  uniform int bodyCount;
  uniform float bodyGate;
`);

/** Shader expression of Σ c·basis over coefficients `begin` to `end` - 1. */
function blend(begin: number, end: number): string {
  const terms = Array.from({ length: end - begin }, (_, i) => {
    const k = begin + i;
    return `c${k >> 2}.${'xyzw'[k & 3]} * vec4(texelFetch(bodyBasis, ivec3(texel, ${1 + k}), 0))`;
  });
  return terms.join(' + ') || 'vec4(0.0)';
}

/** Shader code: each property is its mean plus Σ c·basis; quaternions are stored as wxyz, Spark takes xyzw. */
function statements({ width, ranks }: Capacity, index: string, gsplat: string): string[] {
  const [p, r, l] = ranks;
  const coefficients = Array.from(
    { length: coefficientTexels(ranks) },
    (_, i) => `vec4 c${i} = texelFetch(bodyCoefficients, ivec2(${i}, cluster), 0);`,
  );
  return dyno.unindentLines(`
    ${gsplat}.flags = 0u;
    ${gsplat}.index = ${index};
    if (${index} < bodyCount) {
      ivec2 texel = ivec2(${index} % ${width}, ${index} / ${width});
      vec4 rest = texelFetch(bodyRest, ivec3(texel, 0), 0);
      int cluster = int(rest.w);
      ${coefficients.join(' ')}
      vec4 rotation = vec4(texelFetch(bodyBasis, ivec3(texel, 0), 0)) / 32767.0;
      rotation += ${blend(p, p + r)};
      vec4 growth = ${blend(p + r, p + r + l)};
      ${gsplat}.flags = GSPLAT_FLAG_ACTIVE;
      ${gsplat}.center = rest.xyz + (${blend(0, p)}).xyz;
      ${gsplat}.quaternion = rotation.yzwx * inversesqrt(max(dot(rotation, rotation), 1e-12));
      ${gsplat}.scales = max(texelFetch(bodyRest, ivec3(texel, 1), 0).xyz + growth.xyz, ${LEAST_SCALE});
      ${gsplat}.rgba = texelFetch(bodyColours, ivec3(texel, 0), 0) * vec4(1.0, 1.0, 1.0, bodyGate);
    }
  `);
}
