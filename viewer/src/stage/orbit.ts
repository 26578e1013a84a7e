import * as THREE from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';
import type { StartCamera } from '../bundle/manifest.ts';
import { confine, type Bounds } from './bounds.ts';
import type { Framing, Picture } from './framing.ts';

/** What the camera is pointed at, and what a visitor may do with it. */
export interface Subject {
  up: readonly [number, number, number]; // of the world, the same for every subject
  framing: Framing;
  bounds: (start: StartCamera) => Bounds;
  sideways: number; // rad to walk around, to either side
  face: THREE.Vector3 | null; // what + and − zoom at while it is in the picture
}

const UPWARDS = THREE.MathUtils.degToRad(30);
const KEY_STEP = THREE.MathUtils.degToRad(4);
const KEY_ZOOM = 1.08;
const WHEEL_SPEED = 2; // 10 % for each notch

/**
 * The camera that a visitor moves around the avatar: mouse, touch, arrow keys, + and −.
 *
 * Wheel and fingers zoom at what is under them. Until the visitor moves it, the camera follows the
 * shape of the picture.
 */
export class Orbit {
  readonly camera: THREE.PerspectiveCamera;
  private readonly controls: OrbitControls;
  private subject: Subject;
  private picture: Picture = { aspect: 1, free: 1 };
  private bounds: Bounds | null = null; // none while the camera is being placed
  private moved = false; // by the visitor
  private changed = true;

  constructor(canvas: HTMLCanvasElement, subject: Subject, onChange: () => void) {
    this.subject = subject;
    this.camera = new THREE.PerspectiveCamera(30, 1, 0.01, 100);
    this.camera.up.set(...subject.up); // the controls take it over once
    this.controls = this.control(canvas, onChange);
    this.home();
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

  /** Points the camera at somebody. */
  face(subject: Subject): void {
    this.subject = subject;
    this.home();
  }

  /** Fits the camera to the shape of the picture. */
  fit(picture: Picture): void {
    this.picture = picture;
    this.camera.aspect = picture.aspect;
    const start = this.subject.framing(picture);
    this.camera.fov = start.fov_y;
    this.camera.updateProjectionMatrix();
    if (!this.moved) this.look(start);
    this.changed = true;
  }

  /** Back to where the visitor started. */
  home(): void {
    this.moved = false;
    this.fit(this.picture);
  }

  /** Puts the camera somewhere; what the visitor may do is measured from there. */
  look(start: StartCamera): void {
    const { camera, controls } = this;
    this.release();
    camera.fov = start.fov_y;
    camera.updateProjectionMatrix();
    camera.position.set(...start.eye);
    controls.target.set(...start.target);
    controls.update();
    this.limit(start);
    this.changed = true;
  }

  private control(canvas: HTMLCanvasElement, onChange: () => void): OrbitControls {
    const controls = new OrbitControls(this.camera, canvas);
    controls.zoomToCursor = true;
    const zoomsBy = (speed: number) => () => (controls.zoomSpeed = speed);
    canvas.addEventListener('wheel', zoomsBy(WHEEL_SPEED), { capture: true, passive: true });
    canvas.addEventListener('pointerdown', zoomsBy(1), { capture: true }); // as fast as the fingers
    controls.addEventListener('change', () => {
      this.confine();
      this.changed = true;
      onChange();
    });
    return controls;
  }

  /** Whatever still glides stops, and nothing is in the way of the camera. */
  private release(): void {
    const { controls } = this;
    this.bounds = null;
    controls.enableDamping = false;
    controls.update();
    controls.enableDamping = !matchMedia('(prefers-reduced-motion: reduce)').matches;
    controls.minDistance = controls.minPolarAngle = 0;
    controls.maxDistance = controls.maxAzimuthAngle = Infinity;
    controls.minAzimuthAngle = -Infinity;
    controls.maxPolarAngle = Math.PI;
  }

  private limit(start: StartCamera): void {
    const { controls } = this;
    const { sideways, bounds } = this.subject;
    this.bounds = bounds(start);
    controls.minDistance = this.bounds.nearest;
    controls.maxDistance = this.bounds.farthest;
    controls.minAzimuthAngle = controls.getAzimuthalAngle() - sideways;
    controls.maxAzimuthAngle = controls.getAzimuthalAngle() + sideways;
    controls.minPolarAngle = controls.getPolarAngle() - UPWARDS;
    controls.maxPolarAngle = controls.getPolarAngle() + UPWARDS;
  }

  /** The visitor moved the camera: it stays where there is somebody to see. */
  private confine(): void {
    const { camera, controls, bounds } = this;
    if (!bounds) return;
    this.moved = true;
    const slope = Math.tan(THREE.MathUtils.degToRad(camera.fov) / 2);
    confine(camera.position, controls.target, bounds, slope * Math.min(1, camera.aspect));
    camera.updateMatrixWorld();
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

  /** The face keeps its place in the picture, or what is in the middle where no face is seen. */
  private zoom(factor: number): void {
    const { camera, controls } = this;
    const { minDistance: nearest, maxDistance: farthest } = controls;
    const distance = controls.getDistance();
    const allowed = THREE.MathUtils.clamp(distance * factor, nearest, farthest) / distance;
    const fixed = this.faceInSight() ?? controls.target.clone();
    for (const point of [camera.position, controls.target]) point.sub(fixed).multiplyScalar(allowed).add(fixed);
  }

  private faceInSight(): THREE.Vector3 | null {
    const { face } = this.subject;
    const { x, y, z } = face?.clone().project(this.camera) ?? { x: 1, y: 1, z: 1 };
    return Math.max(Math.abs(x), Math.abs(y), z) < 1 ? face!.clone() : null;
  }
}
