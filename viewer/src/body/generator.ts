import { dyno, SplatGenerator, SplatTransformer } from '@sparkjsdev/spark';
import * as THREE from 'three';
import { splatGenerator, type Generator } from '../gaussians/splat-shader.ts';
import type { SoftObject, Source } from '../soft/source.ts';
import { coefficientPlaces, coefficientTexels, type Capacity, type PackedWindow } from './packed.ts';
import { softWindow } from './soft.ts';
import { coefficientsAt } from './window.ts';

const LEAST_SCALE = '1e-6'; // metres

/**
 * One slot as a Spark generator: a shader that moves the Gaussians of the window in the slot.
 *
 * The slot's capacity never changes. A window that will be seen soon is awake: it is drawn with
 * opacity 0 and takes part in sorting, so that it can appear from one picture to the next. Other
 * windows are asleep and cost next to nothing.
 */
export class WindowGenerator extends SplatGenerator {
  readonly soft: SoftObject;
  private readonly capacity: Capacity;
  private readonly uniforms: Uniforms;
  private readonly found: Float32Array; // coefficients of the window at the posed time
  private content: PackedWindow | null = null;
  private active = false;
  private places: number[] = []; // where each of the window's coefficients is in the texture

  constructor(capacity: Capacity) {
    const uniforms = makeUniforms(capacity);
    const transformer = new SplatTransformer();
    super({
      numSplats: capacity.count,
      generator: makeGenerator(capacity, uniforms, transformer),
      // Without this update, Spark's transformer would place the body at infinity.
      update: () => {
        if (transformer.update(this)) this.updateVersion();
      },
    });
    this.capacity = capacity;
    this.uniforms = uniforms;
    this.found = new Float32Array(this.coefficients.length);
    this.soft = new SoftSlot(uniforms, capacity, () => this.content);
  }

  /** Whether the window takes part in sorting. */
  get awake(): boolean {
    return this.active;
  }

  /** Whether it takes part in sorting only, and is not to be drawn. */
  get unseen(): boolean {
    return this.active && this.uniforms.bodyGate.value === 0;
  }

  /** Puts a window into the slot, asleep. */
  hold(content: PackedWindow): void {
    this.content = content;
    this.places = coefficientPlaces(content.window, this.capacity);
    this.active = false;
    this.uniforms.bodyCount.value = 0;
    this.coefficients.fill(0);
    replace(this.uniforms.bodyRest.value, content.rest);
    replace(this.uniforms.bodyColours.value, content.colours);
    replace(this.uniforms.bodyBasis.value, content.basis);
    this.updateVersion();
  }

  /**
   * Poses the window in the slot, if there is one, at τ in [0, 1], and wakes it.
   *
   * @param visible whether it is seen; else it is drawn with opacity 0
   * @returns whether anything changed
   */
  pose(tau: number, visible: boolean): boolean {
    if (!this.content) return false;
    const { coefficients, uniforms: { bodyCoefficients, bodyCount, bodyGate } } = this;
    coefficientsAt(this.content.curve, tau, this.found);
    const gate = visible ? 1 : 0;
    let changed = gate !== bodyGate.value || !this.active;
    this.active = true;
    bodyCount.value = this.content.window.num_gaussians;
    bodyGate.value = gate;
    this.places.forEach((place, k) => {
      if (coefficients[place] !== this.found[k]) changed = true;
      coefficients[place] = this.found[k]!;
    });
    if (!changed) return false;
    bodyCoefficients.value.needsUpdate = true;
    this.updateVersion();
    return true;
  }

  /**
   * Takes the window out of pictures and sorting.
   *
   * @returns whether anything changed
   */
  sleep(): boolean {
    if (!this.active) return false;
    this.active = false;
    this.uniforms.bodyCount.value = 0;
    this.updateVersion();
    return true;
  }

  private get coefficients(): Float32Array {
    return this.uniforms.bodyCoefficients.value.image.data as Float32Array;
  }
}

/** A slot for the processor's path. */
class SoftSlot implements SoftObject {
  private readonly uniforms: Uniforms;
  private readonly capacity: Capacity;
  private readonly content: () => PackedWindow | null;
  private packed: { content: PackedWindow; source: Source } | null = null;

  constructor(uniforms: Uniforms, capacity: Capacity, content: () => PackedWindow | null) {
    this.uniforms = uniforms;
    this.capacity = capacity;
    this.content = content;
  }

  get source(): Source | null {
    const content = this.content();
    if (content && this.packed?.content !== content) this.packed = { content, source: softWindow(content, this.capacity) };
    return content && this.packed!.source;
  }

  get drawn(): number {
    return this.uniforms.bodyGate.value && this.uniforms.bodyCount.value;
  }

  get values(): Float32Array {
    return this.uniforms.bodyCoefficients.value.image.data as Float32Array;
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

function makeUniforms({ width, rows, clusters, ranks }: Capacity): Uniforms {
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
  const curves = new THREE.DataTexture(new Float32Array(4 * across * clusters), across, clusters, THREE.RGBAFormat, THREE.FloatType);
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

function makeGenerator(capacity: Capacity, uniforms: Uniforms, transformer: SplatTransformer): Generator {
  return splatGenerator(
    { declarations: DECLARATIONS, uniforms, statements: (index, gsplat) => statements(capacity, index, gsplat) },
    transformer,
  );
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
