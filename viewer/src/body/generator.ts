import { dyno, SplatGenerator, SplatTransformer } from '@sparkjsdev/spark';
import * as THREE from 'three';
import { coefficientPlaces, type Capacity, type PackedWindow } from './packed.ts';
import { BASIS_STEP, coefficientsAt } from './window.ts';

/**
 * One slot as a Spark generator: a shader that moves the Gaussians of the window it holds.
 *
 * Its capacity never changes, and a window that is not to be seen yet is drawn with opacity 0 but
 * takes part in sorting, so that it can appear from one picture to the next.
 */
export class WindowGenerator extends SplatGenerator {
  private readonly capacity: Capacity;
  private readonly uniforms: Uniforms;
  private readonly found: Float32Array; // coefficients of the window
  private content: PackedWindow | null = null;
  private places: number[] = [];

  constructor(capacity: Capacity) {
    const uniforms = makeUniforms(capacity);
    const transformer = new SplatTransformer();
    super({
      numSplats: capacity.count,
      generator: makeGenerator(capacity, uniforms, transformer),
      // Without this the program would place the body at infinity.
      update: () => {
        if (transformer.update(this)) this.updateVersion();
      },
    });
    this.capacity = capacity;
    this.uniforms = uniforms;
    this.found = new Float32Array(uniforms.bodyCoefficients.value.length);
  }

  /** Takes a window in. */
  hold(content: PackedWindow): void {
    this.content = content;
    this.places = coefficientPlaces(content.window, this.capacity);
    this.uniforms.bodyCount.value = content.window.num_gaussians;
    this.uniforms.bodyCoefficients.value.fill(0);
    replace(this.uniforms.bodyRest.value, content.rest);
    replace(this.uniforms.bodyColours.value, content.colours);
    replace(this.uniforms.bodyBasis.value, content.basis);
    this.updateVersion();
  }

  /**
   * Shows the window it holds, if any, at τ in [0, 1].
   *
   * @returns whether anything changed
   */
  pose(tau: number, visible: boolean): boolean {
    if (!this.content) return false;
    const { bodyCoefficients: { value }, bodyGate } = this.uniforms;
    coefficientsAt(this.content.curve, tau, this.found);
    const gate = visible ? 1 : 0;
    let changed = gate !== bodyGate.value;
    bodyGate.value = gate;
    this.places.forEach((place, k) => {
      if (value[place] !== this.found[k]) changed = true;
      value[place] = this.found[k]!;
    });
    if (changed) this.updateVersion();
    return changed;
  }
}

interface Uniforms {
  [name: string]: { value: unknown };
  bodyRest: { value: THREE.DataArrayTexture };
  bodyColours: { value: THREE.DataArrayTexture };
  bodyBasis: { value: THREE.DataArrayTexture };
  bodyCoefficients: { value: Float32Array };
  bodyCount: { value: number };
  bodyGate: { value: number };
}

function makeUniforms({ width, rows, ranks }: Capacity): Uniforms {
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
  for (const texture of [rest, colours, basis]) texture.needsUpdate = true;
  return {
    bodyRest: { value: rest },
    bodyColours: { value: colours },
    bodyBasis: { value: basis },
    bodyCoefficients: { value: new Float32Array(size) },
    bodyCount: { value: 0 },
    bodyGate: { value: 0 },
  };
}

function replace(texture: THREE.DataArrayTexture, data: Float32Array | Uint8Array | Int16Array): void {
  texture.image.data = data;
  texture.needsUpdate = true;
}

type Generator = NonNullable<SplatGenerator['generator']>;

function makeGenerator(capacity: Capacity, uniforms: Uniforms, transformer: SplatTransformer): Generator {
  return dyno.dynoBlock({ index: 'int' }, { gsplat: dyno.Gsplat }, ({ index }) => {
    const node = new dyno.Dyno({
      inTypes: { index: 'int' },
      outTypes: { gsplat: dyno.Gsplat },
      inputs: { index },
      generate: ({ inputs, outputs }) => ({
        globals: [dyno.defineGsplat, declarations(capacity)],
        statements: statements(capacity, inputs.index!, outputs.gsplat!),
        uniforms,
      }),
    });
    return { gsplat: transformer.applyGsplat(node.outputs.gsplat) };
  });
}

function declarations({ ranks }: Capacity): string {
  return dyno.unindent(`
    uniform sampler2DArray bodyRest;
    uniform sampler2DArray bodyColours;
    uniform isampler2DArray bodyBasis;
    uniform float bodyCoefficients[${ranks[0] + ranks[1] + ranks[2]}];
    uniform int bodyCount;
    uniform float bodyGate;
    vec4 bodyBlend(ivec2 texel, int begin, int end) {
      vec4 sum = vec4(0.0);
      for (int k = begin; k < end; k++) {
        sum += bodyCoefficients[k] * vec4(texelFetch(bodyBasis, ivec3(texel, 1 + k), 0));
      }
      return sum / ${BASIS_STEP}.0;
    }
  `);
}

/** Everything is its mean plus Σ c·basis; quaternions are kept as wxyz and Spark wants xyzw. */
function statements({ width, ranks: [p, r, l] }: Capacity, index: string, gsplat: string): string[] {
  return dyno.unindentLines(`
    ivec2 texel = ivec2(${index} % ${width}, ${index} / ${width});
    vec4 rotation = vec4(texelFetch(bodyBasis, ivec3(texel, 0), 0)) / 32767.0;
    rotation += bodyBlend(texel, ${p}, ${p + r});
    vec4 growth = bodyBlend(texel, ${p + r}, ${p + r + l});
    ${gsplat}.flags = ${index} < bodyCount ? GSPLAT_FLAG_ACTIVE : 0u;
    ${gsplat}.index = ${index};
    ${gsplat}.center = texelFetch(bodyRest, ivec3(texel, 0), 0).xyz + bodyBlend(texel, 0, ${p}).xyz;
    ${gsplat}.quaternion = rotation.yzwx * inversesqrt(max(dot(rotation, rotation), 1e-12));
    ${gsplat}.scales = exp(texelFetch(bodyRest, ivec3(texel, 1), 0).xyz + growth.xyz);
    ${gsplat}.rgba = texelFetch(bodyColours, ivec3(texel, 0), 0) * vec4(1.0, 1.0, 1.0, bodyGate);
  `);
}
