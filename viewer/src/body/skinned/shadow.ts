import { SHADOW } from '../../shared.ts';
import type { Casters } from './casters.ts';

const { texel: TEXEL, side: SIDE } = SHADOW;

/** The spheres as the lamp sees them: how far towards it the nearest one reaches, in a map that repeats. */
export class ShadowMap {
  readonly depths = new Float32Array(SIDE * SIDE); // metres
  readonly axes: Float64Array; // (3,3) across, up and towards the lamp
  private readonly casters: Casters;

  /** @param direction (3,) towards the lamp */
  constructor(casters: Casters, direction: Float32Array) {
    this.casters = casters;
    this.axes = axesOf(direction);
  }

  /** Draws the spheres as they lie now. */
  draw(): void {
    this.casters.draw(this.axes);
    this.casters.depths(this.depths);
  }
}

/** Unit vectors (3,3) across, up and towards a lamp in a direction (3,). */
export function axesOf(direction: ArrayLike<number>): Float64Array {
  const [x, y, z] = [direction[0]!, direction[1]!, direction[2]!];
  const length = Math.hypot(x, y, z);
  const towards = [x / length, y / length, z / length] as const;
  const up = Math.abs(towards[1]) < 0.99 ? ([0, 1, 0] as const) : ([0, 0, 1] as const);
  const side = cross(up, towards);
  const wide = Math.hypot(...side);
  const across = [side[0] / wide, side[1] / wide, side[2] / wide] as const;
  return Float64Array.from([...across, ...cross(towards, across), ...towards]);
}

type Triple = readonly [number, number, number];

function cross(a: Triple, b: Triple): Triple {
  return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}

/** The share of the lamp's light that reaches a place `skinnedReach(vec3)`, in the shader. */
export const SHADOW_DECLARATIONS = `
  uniform highp sampler2D skinnedShadow;
  uniform vec3 skinnedLamp[4]; // across, up, towards it, and its light

  float skinnedReach(vec3 place) {
    vec2 at = vec2(dot(place, skinnedLamp[0]), dot(place, skinnedLamp[1])) / ${TEXEL};
    float depth = dot(place, skinnedLamp[2]) + ${SHADOW.bias};
    ivec2 corner = ivec2(floor(at));
    vec2 part = at - vec2(corner);
    float share = 0.0;
    for (int down = -1; down < 3; down++) {
      for (int right = -1; right < 3; right++) {
        float nearest = texelFetch(skinnedShadow, (corner + ivec2(right, down)) & ${SIDE - 1}, 0).r;
        vec2 near = 1.0 - 0.5 * abs(part - vec2(right, down));
        share += near.x * near.y * clamp((depth - nearest) / ${SHADOW.edge} + 0.5, 0.0, 1.0);
      }
    }
    return 0.25 * share;
  }

  vec3 skinnedLampLit(vec3 centre, vec3 normal, float sky) { // sky: share of the light from all around
    float facing = max(dot(normal, skinnedLamp[2]) + ${SHADOW.wrap}, 0.0);
    vec3 lamp = facing == 0.0 ? vec3(0.0) : skinnedReach(centre + ${SHADOW.off} * normal) * facing * skinnedLamp[3];
    return log(sky + lamp);
  }
`;
