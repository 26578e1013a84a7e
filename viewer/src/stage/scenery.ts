import * as THREE from 'three';
import type { Backcloth } from '../soft/contract.ts';
import { footprintOf, type Ground, type Patch } from './camera/ground.ts';
import { number, windowLight, WINDOW_LIGHT } from './window-light.ts';

const SHADOW = [0.3, 0.22] as const; // m to the side and to the front where it has faded to a third, until feet are known
const SHADES = { far: 0.34, near: 0.08, sole: 0.5 } as const; // share of the light that is missing: around the feet, between them, under a sole
const NOTICED = 0.004; // m by which feet move before their shadow does
const LAMP = 0.12; // m over the eyes: the middle of the light on the wall
const POOL = 0.45; // m from there to where half of the light is gone
const PUDDLE = 1.3; // m around the feet to where the light on the floor has faded to a third
const FLOOR = [0.9, 0.3] as const; // of the wall's colour beside that light, and how much of the wall's light the feet get
/** Of a room: the wall where its light is, and far from there, and what a window's light adds; display values. */
const ROOMS: Record<'dark' | 'bright', Record<'lit' | 'unlit' | 'sun', readonly [number, number, number]>> = {
  dark: { lit: [0.42, 0.37, 0.335], unlit: [0.105, 0.09, 0.08], sun: [0.2, 0.145, 0.08] },
  bright: { lit: [0.945, 0.92, 0.885], unlit: [0.69, 0.655, 0.62], sun: [0.15, 0.115, 0.06] },
};
/**
 * How much of the room's colour is behind a person, and behind a head alone; the rest is the colour on which they
 * were trained. Of a head alone less is known: its edges hold some of the place where it was recorded.
 */
const OWN = { person: 0.75, head: 0.25 };

/** Where shadows lie, as the shader reads it. */
interface Uniforms {
  under: { value: THREE.Vector3 };
  shadow: { value: THREE.Vector2 };
  soles: { value: THREE.Vector3[] };
  sizes: { value: THREE.Vector2[] };
  depth: { value: number };
}

/**
 * A room behind all Gaussians: a wall in the light of a lamp that falls off around whoever stands before it, with
 * that of a window beside them, a floor that goes over into the wall, and a soft shadow under the feet.
 */
export class Scenery extends THREE.Mesh<THREE.PlaneGeometry, THREE.ShaderMaterial> implements Backcloth {
  version = 0;
  private readonly own: THREE.Vector3;
  private bright = false;
  private share: number = OWN.person;
  private ground: Ground | null = null;
  private followed: Float32Array | null = null;

  /** @param colour of the bundle's background, display values */
  constructor(colour: readonly [number, number, number]) {
    const uniforms = {
      clipToWorld: { value: new THREE.Matrix4() },
      lit: { value: new THREE.Vector3() },
      unlit: { value: new THREE.Vector3() },
      sun: { value: new THREE.Vector3() },
      lamp: { value: new THREE.Vector3() },
      foot: { value: new THREE.Vector3() },
      up: { value: new THREE.Vector3(0, 1, 0) },
      front: { value: new THREE.Vector3(0, 0, 1) },
      shadow: { value: new THREE.Vector2(...SHADOW) },
      under: { value: new THREE.Vector3() },
      soles: { value: [new THREE.Vector3(), new THREE.Vector3()] },
      sizes: { value: [new THREE.Vector2(), new THREE.Vector2()] }, // 0 without a sole
      depth: { value: 1 },
      alone: { value: 0 },
    };
    const material = new THREE.ShaderMaterial({ vertexShader: VERTEX, fragmentShader: FRAGMENT, uniforms, transparent: true });
    material.depthWrite = false; // it is as far away as can be: what is solid lies before it
    super(new THREE.PlaneGeometry(2, 2), material);
    this.own = new THREE.Vector3(...colour);
    this.paint();
    this.frustumCulled = false;
    this.renderOrder = -1;
    this.visible = false; // until somebody stands there
  }

  /**
   * Puts the floor under somebody, and the light behind their head.
   *
   * @param eyes the point between them
   * @param feet whether somebody's feet cast a shadow on it; else a head is there alone
   */
  stand(ground: Ground, eyes: THREE.Vector3, feet = true): void {
    const { foot, up, toward } = ground;
    const { uniforms } = this.material;
    this.ground = ground;
    this.followed = null;
    uniforms.foot!.value.copy(foot);
    uniforms.under!.value.copy(foot);
    uniforms.shadow!.value.set(...SHADOW);
    this.press([]);
    uniforms.up!.value.copy(up);
    uniforms.front!.value.copy(toward);
    uniforms.lamp!.value.copy(eyes).addScaledVector(up, LAMP);
    uniforms.depth!.value = feet ? 1 : 0;
    this.share = feet ? OWN.person : OWN.head;
    this.visible = true;
    this.paint();
  }

  /**
   * Lays the shadow under somebody's feet.
   *
   * @param points (N,3) of the person in the world, m; the same array while nobody has moved
   */
  follow(points: Float32Array): void {
    if (!this.ground || points === this.followed) return;
    this.followed = points;
    const print = footprintOf(points, this.ground);
    if (!print) return;
    const { under, shadow } = this.uniforms;
    const size = new THREE.Vector2(...print.size);
    const still = under.value.distanceTo(print.middle) < NOTICED && shadow.value.distanceTo(size) < NOTICED;
    if (still && !this.steps(print.soles)) return;
    under.value.copy(print.middle);
    shadow.value.copy(size);
    this.press(print.soles);
    this.version++;
  }

  /** Whether soles have moved, come or gone. */
  private steps(now: readonly Patch[]): boolean {
    const { soles, sizes } = this.uniforms;
    return sizes.value.some((size, i) => {
      const sole = now[i];
      return sole ? size.x === 0 || soles.value[i]!.distanceTo(sole.middle) >= NOTICED : size.x > 0;
    });
  }

  /** Puts the shadows of soles where they touch the floor. */
  private press(now: readonly Patch[]): void {
    const { soles, sizes } = this.uniforms;
    for (const [i, size] of sizes.value.entries()) {
      size.set(...(now[i]?.size ?? ([0, 0] as const)));
      soles.value[i]!.copy(now[i]?.middle ?? this.uniforms.under.value);
    }
  }

  private get uniforms(): Uniforms {
    return this.material.uniforms as unknown as Uniforms;
  }

  /** Draws the shadow alone, on what is behind the picture. */
  setShadowAlone(alone: boolean): void {
    this.material.uniforms.alone!.value = alone ? 1 : 0;
  }

  /** Shows a bright room, or a dark one. */
  setBright(bright: boolean): void {
    this.bright = bright;
    this.paint();
  }

  private paint(): void {
    const { lit, unlit, sun } = ROOMS[this.bright ? 'bright' : 'dark'];
    const { uniforms } = this.material;
    uniforms.lit!.value.copy(this.own).lerp(COLOUR.set(...lit), this.share);
    uniforms.unlit!.value.copy(this.own).lerp(COLOUR.set(...unlit), Math.sqrt(this.share)); // nobody's edges are there
    const beside = uniforms.depth!.value; // a head alone might have it in its edges
    uniforms.sun!.value.set(...sun).multiplyScalar(beside);
    this.version++;
  }

  /** Whether it is on stage. */
  get shows(): boolean {
    return this.visible && this.parent !== null;
  }

  /** The same as the shader, for pictures that are drawn without. */
  colour(eye: THREE.Vector3, way: THREE.Vector3, out: Float32Array, at: number): void {
    const { lit, unlit, sun, lamp, foot, up, front } = this.material.uniforms as Record<string, { value: THREE.Vector3 }>;
    const shines = windowLight(eye, way, { foot: foot!.value, up: up!.value, front: front!.value });
    const glow = glowOf(PLACE.copy(lamp!.value).sub(eye), way);
    const rise = way.dot(up!.value);
    const height = SIDE.copy(eye).sub(foot!.value).dot(up!.value);
    let [puddle, wall, shade] = [0, 1, 1];
    if (height > 0 && rise < -1e-4) {
      const place = PLACE.copy(way).multiplyScalar(-height / rise).add(eye).sub(foot!.value);
      wall = THREE.MathUtils.smoothstep(place.length(), 1.2, 5);
      puddle = FLOOR[1] * Math.exp(-place.lengthSq() / PUDDLE ** 2);
      shade = 1 - this.shadowAt(place.add(foot!.value), up!.value, front!.value);
    }
    for (let channel = 0; channel < 3; channel++) {
      const light = lit!.value.getComponent(channel);
      const colour = mix(unlit!.value.getComponent(channel), light, glow) + shines * sun!.value.getComponent(channel);
      out[at + channel] = mix(mix(FLOOR[0] * colour, light, puddle), colour, wall) * shade;
    }
  }

  /** How dark the shadow is at a place of the floor. */
  private shadowAt(place: THREE.Vector3, up: THREE.Vector3, front: THREE.Vector3): number {
    const { under, shadow, soles, sizes, depth } = this.uniforms;
    const side = SIDE.crossVectors(up, front);
    const from = (middle: THREE.Vector3, size: THREE.Vector2) => {
      const away = AWAY.copy(place).sub(middle);
      return (away.dot(side) / size.x) ** 2 + (away.dot(front) / size.y) ** 2;
    };
    const near = from(under.value, shadow.value);
    let light = 1 - SHADES.far * Math.exp(-near) - SHADES.near * Math.exp(-6 * near);
    for (const [i, size] of sizes.value.entries()) {
      if (size.x > 0) light *= 1 - SHADES.sole * Math.exp(-from(soles.value[i]!, size));
    }
    return depth.value * (1 - light);
  }

  dispose(): void {
    this.geometry.dispose();
    this.material.dispose();
  }

  override onBeforeRender: THREE.Mesh['onBeforeRender'] = (_renderer, _scene, camera) => {
    const { value } = this.material.uniforms.clipToWorld!;
    value.multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse).invert();
  };
}

const [PLACE, AWAY, SIDE, COLOUR] = [new THREE.Vector3(), new THREE.Vector3(), new THREE.Vector3(), new THREE.Vector3()];

/**
 * How much of the lamp's light is on the wall in a direction of length 1: half at `POOL` metres beside the lamp's
 * middle. It falls off at every scale, so that close-ups and whole figures have depth.
 *
 * @param lamp from the eye
 */
function glowOf(lamp: THREE.Vector3, way: THREE.Vector3): number {
  const distance = lamp.length();
  const cosine = way.dot(lamp) / distance;
  const beside = (4 * distance ** 2 * (1 - cosine)) / (1.0001 + cosine); // m², squared; twice the tangent of half the angle
  return 1 / (1 + beside / POOL ** 2);
}

function mix(from: number, to: number, share: number): number {
  return from + share * (to - from);
}

const VERTEX = `
  uniform mat4 clipToWorld;
  varying vec3 ray;
  void main() {
    vec4 far = clipToWorld * vec4(position.xy, 1.0, 1.0);
    ray = far.xyz / far.w - cameraPosition;
    gl_Position = vec4(position.xy, 1.0, 1.0);
  }
`;

// Colours are display values, as Gaussians are blended; noise of half a level hides the steps between them.
const FRAGMENT = `
  uniform vec3 lit, unlit, sun, lamp, foot, under, up, front;
  uniform vec3 soles[2];
  uniform vec2 shadow, sizes[2];
  uniform float depth, alone;
  varying vec3 ray;

  ${WINDOW_LIGHT}
  float glowOf(vec3 toLamp, vec3 way) {
    float distance = length(toLamp);
    float cosine = dot(way, toLamp) / distance;
    float beside = 4.0 * distance * distance * (1.0 - cosine) / (1.0001 + cosine);
    return 1.0 / (1.0 + beside / ${number(POOL ** 2)});
  }

  float from(vec3 place, vec3 middle, vec2 size) {
    vec3 away = place - middle;
    vec2 aside = vec2(dot(away, cross(up, front)), dot(away, front)) / size;
    return dot(aside, aside);
  }

  float shadowAt(vec3 place) {
    float near = from(place, under, shadow);
    float light = 1.0 - ${number(SHADES.far)} * exp(-near) - ${number(SHADES.near)} * exp(-6.0 * near);
    for (int i = 0; i < 2; i++) {
      float pressed = from(place, soles[i], max(sizes[i], vec2(1e-4)));
      if (sizes[i].x > 0.0) light *= 1.0 - ${number(SHADES.sole)} * exp(-pressed);
    }
    return depth * (1.0 - light);
  }

  void main() {
    vec3 way = normalize(ray);
    float rise = dot(way, up);
    vec3 colour = mix(unlit, lit, glowOf(lamp - cameraPosition, way)) + sun * windowLight(cameraPosition, way, foot, up, front);
    float dark = 0.0;
    float height = dot(cameraPosition - foot, up);
    if (height > 0.0 && rise < -1e-4) {
      vec3 place = cameraPosition - way * height / rise - foot;
      float puddle = ${number(FLOOR[1])} * exp(-dot(place, place) / ${number(PUDDLE ** 2)});
      vec3 ground = mix(${number(FLOOR[0])} * colour, lit, puddle);
      colour = mix(ground, colour, smoothstep(1.2, 5.0, length(place)));
      dark = shadowAt(place + foot);
    }
    float noise = fract(52.9829189 * fract(dot(gl_FragCoord.xy, vec2(0.06711056, 0.00583715)))) - 0.5;
    gl_FragColor = alone > 0.5 ? vec4(vec3(0.0), dark) : vec4(colour * (1.0 - dark) + noise / 255.0, 1.0);
  }
`;
