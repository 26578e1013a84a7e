import * as THREE from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';
import type { StartCamera } from '../bundle/manifest.ts';
import { confine, freeScale, type Bounds } from './bounds.ts';
import type { Framing, Picture } from './framing.ts';
import { listenToZooming, type Place } from './zooming.ts';

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
  private readonly ending = new AbortController();

  constructor(canvas: HTMLCanvasElement, subject: Subject, onChange: () => void) {
    this.subject = subject;
    this.camera = new THREE.PerspectiveCamera(30, 1, 0.01, 100);
    this.camera.up.set(...subject.up); // the controls take it over once
    this.controls = this.control(canvas, onChange);
    this.home();
    const { signal } = this.ending;
    canvas.addEventListener('keydown', (event) => this.key(event), { signal });
    canvas.addEventListener('dblclick', () => this.home(), { signal });
  }

  /** Stops listening to the visitor. */
  dispose(): void {
    this.ending.abort();
    this.controls.dispose();
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
    if (!this.moved) this.place(start);
    this.changed = true;
  }

  /** Back to where the visitor started. */
  home(): void {
    this.moved = false;
    this.fit(this.picture);
  }

  /** Puts the camera somewhere, as a visitor might; limits are measured from there. */
  look(view: StartCamera): void {
    this.place(view);
    this.moved = true;
  }

  private place(start: StartCamera): void {
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

  /** Turning is the library's; it zooms beside the pointer, so that zooming is done here. */
  private control(canvas: HTMLCanvasElement, onChange: () => void): OrbitControls {
    const controls = new OrbitControls(this.camera, canvas);
    controls.enableZoom = controls.enablePan = false;
    controls.touches.TWO = null;
    controls.addEventListener('change', () => {
      this.confine();
      this.changed = true;
      onChange();
    });
    listenToZooming(canvas, this.ending.signal, {
      zoom: (at, factor) => this.zoom(this.under(at), factor),
      pull: (from, to) => this.move(this.under(from).sub(this.under(to))),
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
      '+': () => this.zoom(this.centre(), 1 / KEY_ZOOM),
      '-': () => this.zoom(this.centre(), KEY_ZOOM),
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

  /** Comes nearer by a factor under 1 to a point, which keeps its place in the picture. */
  private zoom(fixed: THREE.Vector3, factor: number): void {
    const { camera, controls, bounds } = this;
    const { minDistance: nearest, maxDistance: farthest } = controls;
    const distance = controls.getDistance();
    const wanted = THREE.MathUtils.clamp(factor * distance, nearest, farthest) / distance;
    const scaled = (point: THREE.Vector3, by: number) => point.clone().sub(fixed).multiplyScalar(by).add(fixed);
    const allowed = bounds ? freeScale(wanted, (by) => scaled(camera.position, by), bounds) : wanted;
    for (const point of [camera.position, controls.target]) point.copy(scaled(point, allowed));
    controls.update();
  }

  /** Shifts camera and target alike. */
  private move(by: THREE.Vector3): void {
    this.camera.position.add(by);
    this.controls.target.add(by);
    this.controls.update();
  }

  /** What is at a place of the picture, as far away as what the camera looks at. */
  private under([x, y]: Place): THREE.Vector3 {
    const { camera, controls } = this;
    camera.updateMatrixWorld();
    const ahead = controls.target.clone().sub(camera.position);
    const ray = new THREE.Vector3(x, y, 0).unproject(camera).sub(camera.position);
    return ray.multiplyScalar(ahead.lengthSq() / ray.dot(ahead)).add(camera.position);
  }

  /** What keys zoom at: the face, or the middle of the picture where no face is seen. */
  private centre(): THREE.Vector3 {
    const { face } = this.subject;
    const { x, y, z } = face?.clone().project(this.camera) ?? { x: 1, y: 1, z: 1 };
    return (Math.max(Math.abs(x), Math.abs(y), z) < 1 ? face! : this.controls.target).clone();
  }
}
