import { MathUtils, Vector3 } from 'three';

const WALL = 2.4; // m around the feet
const MIDDLE = [0.8, 1.66] as const; // m on the wall to the person's left from right behind, and over the floor
const LEAN = 0.42; // m to the left for each metre of height: the light comes from above, from the right
const PANE = { across: 0.31, up: 0.48 } as const; // m from the middle of one to the next; three in a row, three rows
const HALF = { across: 0.135, up: 0.215 } as const; // m of a pane
const SOFT = 0.065; // m over which the light begins: the sun is no point, nor is the wall in focus

/** Where the wall stands on which the light falls. */
export interface Standing {
  foot: Vector3; // world space, m
  up: Vector3; // of length 1
  front: Vector3; // to the visitor's first place, of length 1
}

/**
 * How much light of a window is on the wall behind a person in a direction of length 1, 0 to 1: nine panes,
 * beside the head of who is seen from the front. The wall is round, so that it is behind people wherever one goes.
 */
export function windowLight(eye: Vector3, way: Vector3, { foot, up, front }: Standing): number {
  const side = SIDE.crossVectors(up, front);
  const from = FROM.subVectors(eye, foot);
  const [x, z, fromX, fromZ] = [way.dot(side), way.dot(front), from.dot(side), from.dot(front)];
  const a = Math.max(x * x + z * z, 1e-4);
  const b = fromX * x + fromZ * z;
  const t = (Math.sqrt(Math.max(b * b - a * (fromX * fromX + fromZ * fromZ - WALL * WALL), 0)) - b) / a;
  const height = from.dot(up) + t * way.dot(up) - MIDDLE[1];
  const along = WALL * Math.atan2(fromX + t * x, -fromZ - t * z) - MIDDLE[0] - LEAN * height;
  return t > 0 ? panes(along, PANE.across, HALF.across) * panes(height, PANE.up, HALF.up) : 0;
}

/** How much light passes three panes side by side at a place in m from their middle. */
function panes(place: number, apart: number, half: number): number {
  const beside = Math.abs(place - apart * Math.min(Math.max(Math.round(place / apart), -1), 1)); // from the nearest's
  return 1 - MathUtils.smoothstep(beside, half - SOFT, half + SOFT);
}

const [SIDE, FROM] = [new Vector3(), new Vector3()];

/** A number as GLSL reads one. */
export const number = (value: number) => value.toFixed(4);

/** The same as `windowLight`, for shaders. */
export const WINDOW_LIGHT = `
  float panes(float place, float apart, float middle) {
    float beside = abs(place - apart * clamp(floor(place / apart + 0.5), -1.0, 1.0));
    return 1.0 - smoothstep(middle - ${number(SOFT)}, middle + ${number(SOFT)}, beside);
  }

  float windowLight(vec3 eye, vec3 way, vec3 foot, vec3 up, vec3 front) {
    vec3 side = cross(up, front);
    vec3 from = eye - foot;
    vec2 flat_way = vec2(dot(way, side), dot(way, front));
    vec2 flat_from = vec2(dot(from, side), dot(from, front));
    float a = max(dot(flat_way, flat_way), 1e-4);
    float b = dot(flat_from, flat_way);
    float t = (sqrt(max(b * b - a * (dot(flat_from, flat_from) - ${number(WALL ** 2)}), 0.0)) - b) / a;
    vec2 place = flat_from + t * flat_way;
    float height = dot(from, up) + t * dot(way, up) - ${number(MIDDLE[1])};
    float along = ${number(WALL)} * atan(place.x, -place.y) - ${number(MIDDLE[0])} - ${number(LEAN)} * height;
    return t > 0.0 ? panes(along, ${number(PANE.across)}, ${number(HALF.across)}) * panes(height, ${number(PANE.up)}, ${number(HALF.up)}) : 0.0;
  }
`;
