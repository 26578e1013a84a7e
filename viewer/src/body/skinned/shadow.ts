import { SHADOW } from '../../shared.ts';

const { radius: RADIUS, texel: TEXEL, side: SIDE, bias: BIAS, edge: EDGE } = SHADOW;
const REACH = RADIUS / TEXEL;
const FAR = -1e9; // where no sphere lies

/** Spheres as a distant lamp sees them: how far towards it the nearest one reaches, in a map that repeats. */
export class ShadowMap {
  readonly depths: Float32Array; // (SIDE,SIDE) metres
  readonly axes: Float64Array; // (3,3) across, up and towards the lamp

  /**
   * @param direction (3,) towards the lamp
   * @param depths room for the map, which others may draw into as well
   */
  constructor(direction: ArrayLike<number>, depths = new Float32Array(SIDE * SIDE)) {
    this.axes = axes(direction);
    this.depths = depths;
  }

  /** Draws spheres, whose centres (M,3) are given. */
  draw(centres: Float64Array): void {
    const [ax, ay, az, bx, by, bz, cx, cy, cz] = this.axes as unknown as Nine;
    this.depths.fill(FAR);
    for (let i = 0; i < centres.length; i += 3) {
      const x = centres[i]!;
      const y = centres[i + 1]!;
      const z = centres[i + 2]!;
      this.sphere((ax * x + ay * y + az * z) / TEXEL, (bx * x + by * y + bz * z) / TEXEL, cx * x + cy * y + cz * z);
    }
  }

  /** The share of the lamp's light that reaches a place, from the 4 × 4 texels about it. */
  reach(x: number, y: number, z: number): number {
    const { axes, depths } = this;
    const across = (axes[0]! * x + axes[1]! * y + axes[2]! * z) / TEXEL;
    const up = (axes[3]! * x + axes[4]! * y + axes[5]! * z) / TEXEL;
    const depth = axes[6]! * x + axes[7]! * y + axes[8]! * z + BIAS;
    const left = Math.floor(across);
    const low = Math.floor(up);
    let share = 0;
    for (let row = low - 1; row < low + 3; row++) {
      const line = (row & (SIDE - 1)) * SIDE;
      const nearY = 1 - 0.5 * Math.abs(up - row);
      for (let column = left - 1; column < left + 3; column++) {
        const before = (depth - depths[line + (column & (SIDE - 1))]!) / EDGE + 0.5;
        if (before > 0) share += nearY * (1 - 0.5 * Math.abs(across - column)) * Math.min(before, 1);
      }
    }
    return 0.25 * share;
  }

  /** Draws a sphere whose centre is at a column and row of the map, and so many metres towards the lamp. */
  private sphere(x: number, y: number, towards: number): void {
    const { depths } = this;
    for (let row = Math.ceil(y - REACH); row <= y + REACH; row++) {
      const line = (row & (SIDE - 1)) * SIDE;
      for (let column = Math.ceil(x - REACH); column <= x + REACH; column++) {
        const left = REACH * REACH - (column - x) * (column - x) - (row - y) * (row - y);
        if (left < 0) continue;
        const depth = towards + TEXEL * Math.sqrt(left);
        const place = line + (column & (SIDE - 1));
        if (depth > depths[place]!) depths[place] = depth;
      }
    }
  }
}

function axes(direction: ArrayLike<number>): Float64Array {
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
type Nine = readonly [number, number, number, number, number, number, number, number, number];

function cross(a: Triple, b: Triple): Triple {
  return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}

/** The share of the lamp's light that reaches a place `skinnedReach(vec3)`, in the shader. */
export const SHADOW_DECLARATIONS = `
  uniform highp sampler2D skinnedShadow;
  uniform vec3 skinnedLamp[4]; // across, up, towards it, and its light

  float skinnedReach(vec3 place) {
    vec2 at = vec2(dot(place, skinnedLamp[0]), dot(place, skinnedLamp[1])) / ${TEXEL};
    float depth = dot(place, skinnedLamp[2]) + ${BIAS};
    ivec2 corner = ivec2(floor(at));
    vec2 part = at - vec2(corner);
    float share = 0.0;
    for (int down = -1; down < 3; down++) {
      for (int right = -1; right < 3; right++) {
        float nearest = texelFetch(skinnedShadow, (corner + ivec2(right, down)) & ${SIDE - 1}, 0).r;
        vec2 near = 1.0 - 0.5 * abs(part - vec2(right, down));
        share += near.x * near.y * clamp((depth - nearest) / ${EDGE} + 0.5, 0.0, 1.0);
      }
    }
    return 0.25 * share;
  }

  vec3 skinnedLampLit(vec3 centre, vec3 normal) {
    float facing = max(dot(normal, skinnedLamp[2]) + ${SHADOW.wrap}, 0.0);
    return facing == 0.0 ? vec3(0.0) : log(1.0 + skinnedReach(centre + ${SHADOW.off} * normal) * facing * skinnedLamp[3]);
  }
`;
