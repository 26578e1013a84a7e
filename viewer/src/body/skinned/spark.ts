import { dyno } from '@sparkjsdev/spark';
import * as THREE from 'three';
import { SHADOW } from '../../shared.ts';
import { SparkTwin } from '../../gaussians/spark.ts';
import type { BakedLamp } from './baked.ts';
import type { SkinnedGenerator } from './generator.ts';
import { fillTexels, makeTexels, type Texels } from './packed.ts';
import { SHADOW_DECLARATIONS, type ShadowMap } from './shadow.ts';
import { TABLE_ROW } from './skeleton.ts';

const SHAPE_WORDS = 1.5; // 32-bit words of a residual shape: six bytes, three of position and three of logits
const MILLIMETRE = '1e-3';

/** A body on a skeleton as Spark draws it: a shader moves, turns and colours its Gaussians with their joints. */
export class SparkSkinned extends SparkTwin {
  constructor(body: SkinnedGenerator) {
    const { baked, map } = body;
    const { info, lamp } = baked;
    const texels = makeTexels(info);
    const shadow = lamp && map && makeShadow(lamp, map);
    const uniforms = { ...makeUniforms(body, texels), ...shadow?.uniforms };
    let filled = 0; // parts
    let gaussians = 0;
    const follow = () => {
      for (const part of body.parts.slice(filled)) {
        fillTexels(texels, part, gaussians);
        uniforms.skinnedTexels.value.needsUpdate = true;
        gaussians += part.count;
        filled++;
      }
      uniforms.skinnedJoints.value.needsUpdate = true;
      if (shadow) shadow.texture.needsUpdate = true;
      body.residual.forEach((value, k) => uniforms.skinnedResidual.value[k >> 2]!.setComponent(k & 3, value));
      uniforms.skinnedGrown.value = body.grown;
      uniforms.skinnedWide.value = body.wide;
      uniforms.skinnedCount.value = body.most;
    };
    const declarations = lamp ? DECLARATIONS + dyno.unindent(SHADOW_DECLARATIONS) : DECLARATIONS;
    const lit = lamp ? ' + skinnedLampLit(centre, normal)' : '';
    super(body, { declarations, uniforms, statements: (index, gsplat) => statements(texels, info.num_shapes, lit, index, gsplat) }, follow);
  }
}

interface Uniforms {
  [name: string]: { value: unknown };
  skinnedTexels: { value: THREE.DataArrayTexture };
  skinnedJoints: { value: THREE.DataTexture }; // one row per joint, see TABLE_ROW
  skinnedResidual: { value: THREE.Vector4[] }; // coefficients of the residual shapes
  skinnedLight: { value: THREE.Vector3[] }; // (8,3) coefficients of spherical harmonics
  skinnedCount: { value: number }; // Gaussians that are drawn
  skinnedFirst: { value: number }; // Gaussians that came first
  skinnedGrown: { value: number }; // share of their opacity that the others have
  skinnedWide: { value: number }; // by which sizes of the first ones are multiplied
}

function makeUniforms({ baked: { info, count, light }, table }: SkinnedGenerator, { width, rows, layers, words }: Texels): Uniforms {
  const texels = new THREE.DataArrayTexture(words, width, rows, layers);
  texels.format = THREE.RGBAIntegerFormat;
  texels.type = THREE.UnsignedIntType;
  texels.internalFormat = 'RGBA32UI';
  const joints = info.names.length;
  const jointTexels = new THREE.DataTexture(table, TABLE_ROW / 4, joints, THREE.RGBAFormat, THREE.FloatType);
  for (const texture of [texels, jointTexels]) texture.needsUpdate = true;
  return {
    skinnedTexels: { value: texels },
    skinnedJoints: { value: jointTexels },
    skinnedResidual: { value: [new THREE.Vector4(), new THREE.Vector4()] },
    skinnedLight: { value: Array.from({ length: 8 }, (_, i) => new THREE.Vector3().fromArray(light, 3 * i)) },
    skinnedCount: { value: info.num_gaussians },
    skinnedFirst: { value: count },
    skinnedGrown: { value: 0 },
    skinnedWide: { value: 1 },
  };
}

/** What the lamp sees, as a texture, and the lamp. */
interface Shadow {
  texture: THREE.DataTexture;
  uniforms: Record<string, { value: unknown }>;
}

function makeShadow(lamp: BakedLamp, map: ShadowMap): Shadow {
  const texture = new THREE.DataTexture(map.depths, SHADOW.side, SHADOW.side, THREE.RedFormat, THREE.FloatType);
  texture.needsUpdate = true;
  const axes = [0, 3, 6].map((at) => new THREE.Vector3().fromArray(map.axes, at));
  const lit = [...axes, new THREE.Vector3().fromArray(lamp.strength)];
  return { texture, uniforms: { skinnedShadow: { value: texture }, skinnedLamp: { value: lit } } };
}

const DECLARATIONS = dyno.unindent(`
  uniform usampler2DArray skinnedTexels;
  uniform sampler2D skinnedJoints;
  uniform vec4 skinnedResidual[2];
  uniform vec3 skinnedLight[8];
  uniform int skinnedCount;
  uniform int skinnedFirst;
  uniform float skinnedGrown;
  uniform float skinnedWide;

  vec4 skinnedBytes(uint word) {
    return vec4(ivec4(uvec4(word) << uvec4(24u, 16u, 8u, 0u)) >> 24);
  }

  vec2 skinnedShorts(uint word) {
    return vec2(ivec2(uvec2(word) << uvec2(16u, 0u)) >> 16);
  }

  vec4 skinnedProduct(vec4 a, vec4 b) { // of quaternions wxyz
    return vec4(a.x * b.x - dot(a.yzw, b.yzw), a.x * b.yzw + b.x * a.yzw + cross(a.yzw, b.yzw));
  }

  vec3 skinnedLit(vec3 n) { // spherical harmonics of degrees 1 and 2
    return 0.4886025119029199 * (n.z * skinnedLight[1] - n.y * skinnedLight[0] - n.x * skinnedLight[2])
      + 1.0925484305920792 * (n.x * n.y * skinnedLight[3] - n.y * n.z * skinnedLight[4] - n.x * n.z * skinnedLight[6])
      + 0.31539156525252005 * (2.0 * n.z * n.z - n.x * n.x - n.y * n.y) * skinnedLight[5]
      + 0.5462742152960396 * (n.x * n.x - n.y * n.y) * skinnedLight[7];
  }
`);

/**
 * Shader code that sums the residual shapes: `moved` = Σ κ·position and `tinted` = Σ κ·logits.
 *
 * A shape has six signed bytes; those of successive shapes follow each other without gaps.
 */
function residual(shapes: number): string {
  const words = Math.ceil(SHAPE_WORDS * shapes);
  const layers = Array.from({ length: Math.ceil(words / 4) }, (_, i) => `uvec4 l${i} = texelFetch(skinnedTexels, ivec3(texel, ${3 + i}), 0);`);
  const unpacked = Array.from({ length: words }, (_, i) => `vec4 s${i} = skinnedBytes(l${i >> 2}.${'xyzw'[i & 3]});`);
  const byte = (at: number) => `s${at >> 2}.${'xyzw'[at & 3]}`;
  const sum = (begin: number) =>
    Array.from({ length: shapes }, (_, k) => {
      const at = 6 * k + begin;
      return `skinnedResidual[${k >> 2}].${'xyzw'[k & 3]} * vec3(${byte(at)}, ${byte(at + 1)}, ${byte(at + 2)})`;
    }).join(' + ');
  return `${layers.join(' ')} ${unpacked.join(' ')} vec3 moved = ${sum(0)}; vec3 tinted = ${sum(3)};`;
}

function statements({ width }: Texels, shapes: number, lit: string, index: string, gsplat: string): string[] {
  return dyno.unindentLines(`
    ${gsplat}.flags = 0u;
    ${gsplat}.index = ${index};
    float grown = ${index} < skinnedFirst ? 1.0 : skinnedGrown;
    if (${index} < skinnedCount && grown > 0.0) {
      ivec2 texel = ivec2(${index} % ${width}, ${index} / ${width});
      uvec4 a = texelFetch(skinnedTexels, ivec3(texel, 0), 0);
      uvec4 b = texelFetch(skinnedTexels, ivec3(texel, 1), 0);
      uvec4 c = texelFetch(skinnedTexels, ivec3(texel, 2), 0);
      uvec4 joints = (uvec4(a.w) >> uvec4(0u, 8u, 16u, 24u)) & 255u;
      vec4 weights = vec4((uvec4(b.z) >> uvec4(0u, 8u, 16u, 24u)) & 255u) / 255.0;
      vec4 x = vec4(0.0); vec4 y = vec4(0.0); vec4 z = vec4(0.0); vec4 turn = vec4(0.0);
      for (int k = 0; k < 4; k++) {
        if (weights[k] == 0.0) continue;
        int joint = int(joints[k]);
        x += weights[k] * texelFetch(skinnedJoints, ivec2(0, joint), 0);
        y += weights[k] * texelFetch(skinnedJoints, ivec2(1, joint), 0);
        z += weights[k] * texelFetch(skinnedJoints, ivec2(2, joint), 0);
        turn += weights[k] * texelFetch(skinnedJoints, ivec2(3, joint), 0);
      }
      ${residual(shapes)}
      vec2 units = unpackHalf2x16(c.w);
      vec4 rest = vec4(uintBitsToFloat(a.xyz) + ${MILLIMETRE} * units.x * moved, 1.0);
      vec3 normal = skinnedBytes(b.w).xyz;
      normal = vec3(dot(x.xyz, normal), dot(y.xyz, normal), dot(z.xyz, normal));
      normal *= inversesqrt(max(dot(normal, normal), 1e-12));
      vec4 rotation = skinnedProduct(turn, vec4(skinnedShorts(b.x), skinnedShorts(b.y)) / 32767.0);
      vec3 centre = vec3(dot(x, rest), dot(y, rest), dot(z, rest));
      vec2 between = unpackHalf2x16(c.y);
      vec3 logits = vec3(between.y, unpackHalf2x16(c.z)) + units.y * tinted + skinnedLit(normal)${lit};
      ${gsplat}.flags = GSPLAT_FLAG_ACTIVE;
      ${gsplat}.center = centre;
      ${gsplat}.quaternion = rotation.yzwx * inversesqrt(max(dot(rotation, rotation), 1e-12));
      ${gsplat}.scales = exp(vec3(unpackHalf2x16(c.x), between.x)) * (${index} < skinnedFirst ? skinnedWide : 1.0);
      ${gsplat}.rgba = vec4(1.0 / (1.0 + exp(-logits)), grown * float(b.w >> 24u) / 255.0);
    }
  `);
}
