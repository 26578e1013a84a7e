import * as THREE from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';
import type { StartCamera } from '../bundle/manifest.ts';

/** What a visitor may do. */
export interface Freedom {
  sideways: number; // rad to walk around, to either side
  nearest: number; // of the start distance
  narrowest: number; // width / height under which the view widens instead of cutting off the sides
}

/** Heads are recorded from the front. */
export const IN_FRONT: Freedom = { sideways: THREE.MathUtils.degToRad(75), nearest: 0.5, narrowest: 0.8 };

/** Bodies are recorded from all around. */
export const AROUND: Freedom = { sideways: Infinity, nearest: 0.2, narrowest: 0.45 };

const UPWARDS = THREE.MathUtils.degToRad(30);
const FARTHEST = 1.8; // of the start distance
const KEY_STEP = THREE.MathUtils.degToRad(4);
const KEY_ZOOM = 1.08;

/** The camera that a visitor moves around the avatar: mouse, touch, arrow keys, + and −. */
export class Orbit {
  readonly camera: THREE.PerspectiveCamera;
  private readonly controls: OrbitControls;
  private readonly start: StartCamera;
  private readonly freedom: Freedom;
  private changed = true;

  constructor(canvas: HTMLCanvasElement, start: StartCamera, freedom: Freedom, onChange: () => void) {
    this.start = start;
    this.freedom = freedom;
    this.camera = new THREE.PerspectiveCamera(start.fov_y, 1, 0.01, 100);
    this.camera.up.set(...start.up);
    this.camera.position.set(...start.eye);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.target.set(...start.target);
    this.controls.enablePan = false;
    this.controls.enableDamping = !matchMedia('(prefers-reduced-motion: reduce)').matches;
    this.limit();
    this.controls.addEventListener('change', () => {
      this.changed = true;
      onChange();
    });
    canvas.addEventListener('keydown', (event) => this.key(event));
    canvas.addEventListener('dblclick', () => this.home());
  }

  /** Lets the camera glide on; true if it moved. */
  update(): boolean {
    this.controls.update();
    const changed = this.changed;
    this.changed = false;
    return changed;
  }

  resize(aspect: number): void {
    const widened = Math.max(1, this.freedom.narrowest / aspect);
    const half = Math.tan(THREE.MathUtils.degToRad(this.start.fov_y) / 2) * widened;
    this.camera.fov = THREE.MathUtils.radToDeg(2 * Math.atan(half));
    this.camera.aspect = aspect;
    this.camera.updateProjectionMatrix();
    this.changed = true;
  }

  /** Back to where the visitor started. */
  home(): void {
    this.camera.position.set(...this.start.eye);
    this.controls.update();
  }

  private limit(): void {
    const { controls, freedom } = this;
    controls.update();
    const distance = controls.getDistance();
    controls.minDistance = freedom.nearest * distance;
    controls.maxDistance = FARTHEST * distance;
    controls.minAzimuthAngle = controls.getAzimuthalAngle() - freedom.sideways;
    controls.maxAzimuthAngle = controls.getAzimuthalAngle() + freedom.sideways;
    controls.minPolarAngle = controls.getPolarAngle() - UPWARDS;
    controls.maxPolarAngle = controls.getPolarAngle() + UPWARDS;
  }

  private key(event: KeyboardEvent): void {
    const moves: Record<string, () => void> = {
      ArrowLeft: () => this.turn(this.camera.up, KEY_STEP),
      ArrowRight: () => this.turn(this.camera.up, -KEY_STEP),
      ArrowUp: () => this.turn(this.right(), -KEY_STEP),
      ArrowDown: () => this.turn(this.right(), KEY_STEP),
      '+': () => this.zoom(1 / KEY_ZOOM),
      '-': () => this.zoom(KEY_ZOOM),
      Home: () => this.home(),
    };
    const move = moves[event.key];
    if (!move) return;
    event.preventDefault();
    move();
    this.controls.update(); // keeps the limits
  }

  private right(): THREE.Vector3 {
    return new THREE.Vector3().setFromMatrixColumn(this.camera.matrixWorld, 0);
  }

  private turn(axis: THREE.Vector3, angle: number): void {
    const offset = this.camera.position.clone().sub(this.controls.target).applyAxisAngle(axis, angle);
    this.camera.position.copy(this.controls.target).add(offset);
  }

  private zoom(factor: number): void {
    this.camera.position.sub(this.controls.target).multiplyScalar(factor).add(this.controls.target);
  }
}
