import { SHADOW } from '../../shared.ts';
import type { BakedLamp } from './baked.ts';
import { TABLE_ROW } from './skeleton.ts';

const { radius: RADIUS, texel: TEXEL, side: SIDE } = SHADOW;
const REACH = RADIUS / TEXEL;
const POINT = 1e-4; // metres
const FAR = -1e9; // where no sphere lies
const OUTSIDE = 2 ** 30; // columns and rows beyond which nobody stands, and far beyond which counting by one goes nowhere

/** The spheres as the lamp sees them: how far towards it the nearest one reaches, in a map that repeats. */
export class ShadowMap {
  readonly depths = new Float32Array(SIDE * SIDE).fill(FAR); // metres
  readonly axes: Float64Array; // (3,3) across, up and towards the lamp
  private readonly lamp: BakedLamp;
  private readonly seen: Float64Array; // (J,3,4) where joints take their points, by the lamp's axes
  private readonly rows = new Float64Array(12); // of one sphere

  constructor(lamp: BakedLamp, joints: number) {
    this.lamp = lamp;
    this.axes = axes(lamp.direction);
    this.seen = new Float64Array(12 * joints);
  }

  /** Draws the spheres as they lie in a pose, whose joint table (J,TABLE_ROW) is given. */
  draw(table: Float32Array): void {
    const { points, joints, weights } = this.lamp;
    const { depths, rows, seen } = this;
    this.turn(table);
    depths.fill(FAR);
    for (let i = 0; i < points.length; i += 3) {
      rows.fill(0);
      for (let k = (4 * i) / 3, end = k + 4; k < end; k++) {
        const weight = weights[k]! / 255;
        if (weight === 0) continue;
        for (let c = 0, at = 12 * joints[k]!; c < 12; c++) rows[c]! += weight * seen[at + c]!;
      }
      const x = points[i]! * POINT;
      const y = points[i + 1]! * POINT;
      const z = points[i + 2]! * POINT;
      this.sphere(
        (rows[0]! * x + rows[1]! * y + rows[2]! * z + rows[3]!) / TEXEL,
        (rows[4]! * x + rows[5]! * y + rows[6]! * z + rows[7]!) / TEXEL,
        rows[8]! * x + rows[9]! * y + rows[10]! * z + rows[11]!,
      );
    }
  }

  /** Turns the joints' matrices (R | t) towards the lamp. */
  private turn(table: Float32Array): void {
    const { axes, seen } = this;
    for (let joint = 0; joint < seen.length / 12; joint++) {
      const from = TABLE_ROW * joint;
      for (let r = 0; r < 3; r++) {
        for (let c = 0; c < 4; c++) {
          const value = axes[3 * r]! * table[from + c]! + axes[3 * r + 1]! * table[from + 4 + c]!;
          seen[12 * joint + 4 * r + c] = value + axes[3 * r + 2]! * table[from + 8 + c]!;
        }
      }
    }
  }

  /** Draws a sphere whose centre is at a column and row of the map, and so many metres towards the lamp. */
  private sphere(x: number, y: number, towards: number): void {
    if (!(Math.abs(x) < OUTSIDE && Math.abs(y) < OUTSIDE)) return;
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

function axes([x, y, z]: Float32Array): Float64Array {
  const length = Math.hypot(x!, y!, z!);
  const towards = [x! / length, y! / length, z! / length] as const;
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

  vec3 skinnedLampLit(vec3 centre, vec3 normal) {
    float facing = max(dot(normal, skinnedLamp[2]) + ${SHADOW.wrap}, 0.0);
    return facing == 0.0 ? vec3(0.0) : log(1.0 + skinnedReach(centre + ${SHADOW.off} * normal) * facing * skinnedLamp[3]);
  }
`;
