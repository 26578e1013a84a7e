import * as THREE from 'three';
import type { Backcloth } from '../soft/contract.ts';
import { footprintOf, type Ground } from './camera/ground.ts';

const SHADOW = [0.3, 0.22] as const; // m to the side and to the front where it has faded to a third, until feet are known
const NOTICED = 0.004; // m by which feet move before their shadow does

/**
 * A wall and a floor that go over into each other, and a soft shadow under the feet, behind all
 * Gaussians. Where heads are, the colour is that on which the person was trained: edges stay clean.
 */
export class Scenery extends THREE.Mesh<THREE.PlaneGeometry, THREE.ShaderMaterial> implements Backcloth {
  version = 0;
  private ground: Ground | null = null;
  private followed: Float32Array | null = null;

  /** @param colour of the bundle's background, display values */
  constructor(colour: readonly [number, number, number]) {
    const uniforms = {
      clipToWorld: { value: new THREE.Matrix4() },
      base: { value: new THREE.Vector3(...colour) },
      bright: { value: 0 },
      foot: { value: new THREE.Vector3() },
      up: { value: new THREE.Vector3(0, 1, 0) },
      front: { value: new THREE.Vector3(0, 0, 1) },
      shadow: { value: new THREE.Vector2(...SHADOW) },
      under: { value: new THREE.Vector3() },
      depth: { value: 1 },
      alone: { value: 0 },
    };
    const material = new THREE.ShaderMaterial({ vertexShader: VERTEX, fragmentShader: FRAGMENT, uniforms, transparent: true });
    material.depthWrite = false; // it is as far away as can be: what is solid lies before it
    super(new THREE.PlaneGeometry(2, 2), material);
    this.frustumCulled = false;
    this.renderOrder = -1;
    this.visible = false; // until somebody stands there
  }

  /**
   * Puts the floor under somebody.
   *
   * @param feet whether somebody's feet cast a shadow on it
   */
  stand(ground: Ground, feet = true): void {
    const { foot, up, toward } = ground;
    const { uniforms } = this.material;
    this.ground = ground;
    this.followed = null;
    uniforms.foot!.value.copy(foot);
    uniforms.under!.value.copy(foot);
    uniforms.shadow!.value.set(...SHADOW);
    uniforms.up!.value.copy(up);
    uniforms.front!.value.copy(toward);
    uniforms.depth!.value = feet ? 1 : 0;
    this.visible = true;
    this.version++;
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
    const { under, shadow } = this.material.uniforms as { under: { value: THREE.Vector3 }; shadow: { value: THREE.Vector2 } };
    const size = new THREE.Vector2(...print.size);
    if (under.value.distanceTo(print.middle) < NOTICED && shadow.value.distanceTo(size) < NOTICED) return;
    under.value.copy(print.middle);
    shadow.value.copy(size);
    this.version++;
  }

  /** Draws the shadow alone, on what is behind the picture. */
  setShadowAlone(alone: boolean): void {
    this.material.uniforms.alone!.value = alone ? 1 : 0;
  }

  /** Shows a bright room, or a dark one. */
  setBright(bright: boolean): void {
    this.material.uniforms.bright!.value = bright ? 1 : 0;
    this.version++;
  }

  /** Whether it is on stage. */
  get shows(): boolean {
    return this.visible && this.parent !== null;
  }

  /** The same as the shader, for pictures that are drawn without. */
  colour(eye: THREE.Vector3, way: THREE.Vector3, out: Float32Array, at: number): void {
    const { base, foot, up, front, under } = this.material.uniforms as Record<string, { value: THREE.Vector3 }>;
    const shadow = this.material.uniforms.shadow!.value as THREE.Vector2;
    const { bright, depth } = this.material.uniforms as Record<string, { value: number }>;
    const light = bright!.value > 0.5;
    const rise = way.dot(up!.value);
    const height = (eye.x - foot!.value.x) * up!.value.x + (eye.y - foot!.value.y) * up!.value.y + (eye.z - foot!.value.z) * up!.value.z;
    const sky = smoothstep(0.12, 0.6, rise);
    let [ground, far, shade] = [0, 1, 1];
    if (height > 0 && rise < -1e-4) {
      const place = PLACE.copy(way).multiplyScalar(-height / rise).add(eye).sub(foot!.value);
      const away = place.length();
      ground = smoothstep(0, 2.2, away);
      far = smoothstep(1.2, 5, away);
      place.add(foot!.value).sub(under!.value);
      const side = place.dot(SIDE.crossVectors(up!.value, front!.value)) / shadow.x;
      const ahead = place.dot(front!.value) / shadow.y;
      const near = side * side + ahead * ahead;
      shade = 1 - depth!.value * (0.34 * Math.exp(-near) + 0.22 * Math.exp(-6 * near));
    }
    for (let channel = 0; channel < 3; channel++) {
      const own = base!.value.getComponent(channel);
      const shaded = (dark: number, bright: number) => (light ? mix(own, 1, bright) : own * dark);
      const floor = mix(shaded(1.06, 0.3), shaded(0.78, 0.12), ground);
      out[at + channel] = far < 1 || shade < 1 ? mix(floor, own, far) * shade : mix(own, shaded(0.66, 0.5), sky);
    }
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

const [PLACE, SIDE] = [new THREE.Vector3(), new THREE.Vector3()];

function mix(from: number, to: number, share: number): number {
  return from + share * (to - from);
}

function smoothstep(low: number, high: number, value: number): number {
  const share = Math.min(Math.max((value - low) / (high - low), 0), 1);
  return share * share * (3 - 2 * share);
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
  uniform vec3 base, foot, under, up, front;
  uniform vec2 shadow;
  uniform float bright, depth, alone;
  varying vec3 ray;

  vec3 shade(float dark, float light) {
    return bright > 0.5 ? mix(base, vec3(1.0), light) : base * dark;
  }

  void main() {
    vec3 way = normalize(ray);
    float rise = dot(way, up);
    vec3 colour = mix(base, shade(0.66, 0.5), smoothstep(0.12, 0.6, rise));
    float dark = 0.0;
    float height = dot(cameraPosition - foot, up);
    if (height > 0.0 && rise < -1e-4) {
      vec3 place = cameraPosition - way * height / rise - foot;
      float far = length(place);
      vec3 ground = mix(shade(1.06, 0.3), shade(0.78, 0.12), smoothstep(0.0, 2.2, far));
      colour = mix(ground, base, smoothstep(1.2, 5.0, far));
      vec3 away = place + foot - under;
      vec2 aside = vec2(dot(away, cross(up, front)), dot(away, front)) / shadow;
      float near = dot(aside, aside);
      dark = depth * (0.34 * exp(-near) + 0.22 * exp(-6.0 * near));
    }
    float noise = fract(52.9829189 * fract(dot(gl_FragCoord.xy, vec2(0.06711056, 0.00583715)))) - 0.5;
    gl_FragColor = alone > 0.5 ? vec4(vec3(0.0), dark) : vec4(colour * (1.0 - dark) + noise / 255.0, 1.0);
  }
`;
