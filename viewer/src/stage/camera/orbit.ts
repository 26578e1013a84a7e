import * as THREE from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';
import type { StartCamera } from '../../bundle/manifest.ts';
import { confine, freeScale, type Bounds, type Lens } from './bounds.ts';
import { Flight, directionOf } from './flight.ts';
import type { Framing, Picture, View } from './framing.ts';
import type { CameraKey } from './keys.ts';
import { listenToZooming, placeOn, type Place } from './zooming.ts';

/** What the camera is pointed at, and what a visitor may do with it. */
export interface Subject {
  up: readonly [number, number, number]; // of the world, the same for every subject
  framings: Partial<Record<View, Framing>>;
  home: View; // where the visitor starts
  bounds: (start: StartCamera) => Bounds;
  sideways: number; // rad to walk around, to either side
  face: THREE.Vector3 | null; // what + and − zoom at while it is in the picture
}

const UPWARDS = THREE.MathUtils.degToRad(30);
const KEY_STEP = THREE.MathUtils.degToRad(4);
const KEY_ZOOM = 1.08;
const FOCUS = 0.5; // of the distance that is left after a double click
const ROOM = 1.25; // times the least distance: nearer, a double click goes back
const ROUNDING = 1e-9; // m, and parts of a quaternion: no movement
const BESIDE = 0.45; // m from the spine: what is farther is nobody
const HEAD = 0.2; // m around the eyes, where no arms are

/** A flight that has begun. */
interface Journey {
  path: Flight;
  seconds: number; // since it began
  land: () => void; // when it is over
}

/**
 * The camera that a visitor moves around the avatar: mouse, touch, arrow keys, + and −.
 *
 * Wheel and fingers zoom at what is under them, a double click flies there. Until the visitor moves
 * it, the camera follows the shape of the picture.
 */
export class Orbit {
  readonly camera: THREE.PerspectiveCamera;
  private readonly controls: OrbitControls;
  private subject: Subject;
  private picture: Picture = { aspect: 1, free: 1 };
  private bounds: Bounds | null = null; // none while the camera is being placed
  private moved = false; // by the visitor
  private chosen: View; // where limits are measured from
  private journey: Journey | null = null;
  private changed = true;
  private readonly ending = new AbortController();
  /** Called when another view is shown, or none of them any more. */
  onView: (view: View | null) => void = () => {};

  constructor(canvas: HTMLCanvasElement, subject: Subject, onChange: () => void) {
    this.subject = subject;
    this.chosen = subject.home;
    this.camera = new THREE.PerspectiveCamera(30, 1, 0.01, 100);
    this.camera.up.set(...subject.up); // the controls take it over once
    this.controls = this.control(canvas, onChange);
    this.home();
    const { signal } = this.ending;
    canvas.addEventListener('keydown', (event) => this.key(event), { signal });
    canvas.addEventListener('dblclick', (event) => this.focus(placeOn(canvas, event)), { signal });
  }

  /** Lets the camera glide or fly on by some seconds; true if it moved. */
  update(step = 0): boolean {
    if (this.journey) this.travel(this.journey, step);
    this.glide();
    const changed = this.changed;
    this.changed = false;
    return changed;
  }

  /** What the visitor turned runs out. At rest the library moves the camera by its last digits, picture by picture: no picture would be of the same view. */
  private glide(): void {
    const { position, quaternion } = this.camera;
    const [place, turn] = [position.clone(), quaternion.clone()];
    this.controls.update();
    const moves = [...position.toArray(), ...quaternion.toArray()];
    if (![...place.toArray(), ...turn.toArray()].every((before, i) => Math.abs(moves[i]! - before) < ROUNDING)) return;
    position.copy(place);
    quaternion.copy(turn);
  }

  /** Points the camera at somebody. */
  face(subject: Subject): void {
    this.subject = subject;
    this.home();
  }

  /** The views that there are of the subject. */
  get views(): View[] {
    return Object.keys(this.subject.framings) as View[];
  }

  /** The view that is shown or flown to; null where the visitor went elsewhere. */
  get view(): View | null {
    return this.moved ? null : this.chosen;
  }

  /** Flies to a view, if there is such a one. */
  show(view: View): void {
    if (!this.subject.framings[view]) return;
    this.chosen = view;
    this.setMoved(false);
    const start = this.start();
    this.fly(start, () => this.place(start));
  }

  /** Fits the camera to the shape of the picture. */
  fit(picture: Picture): void {
    this.picture = picture;
    this.camera.aspect = picture.aspect;
    const start = this.start();
    if (this.journey && !this.moved) this.fly(start, () => this.place(start));
    else if (!this.moved) this.place(start);
    else this.camera.fov = start.fov_y;
    this.camera.updateProjectionMatrix();
    this.changed = true;
  }

  /** Back to where the visitor started. */
  home(): void {
    this.chosen = this.subject.home;
    this.journey = null;
    this.setMoved(false);
    this.fit(this.picture);
  }

  /** Puts the camera somewhere, as a visitor might; limits are measured from there. */
  look(view: StartCamera): void {
    this.journey = null;
    this.place(view);
    this.setMoved(true);
  }

  /** Stops listening to the visitor. */
  dispose(): void {
    this.ending.abort();
    this.controls.dispose();
  }

  /** Where the chosen view begins. */
  private start(): StartCamera {
    return this.subject.framings[this.chosen]!(this.picture);
  }

  private place(start: StartCamera): void {
    this.release();
    this.stand(start);
    this.limit(start);
    this.changed = true;
  }

  private stand({ eye, target, fov_y: fov }: StartCamera): void {
    const { camera, controls } = this;
    camera.fov = fov;
    camera.updateProjectionMatrix();
    camera.position.set(...eye);
    controls.target.set(...target);
    controls.update();
  }

  /** Flies somewhere; jumps where the visitor wants little motion. */
  private fly(to: StartCamera, land: () => void): void {
    const { camera, controls } = this;
    const up = camera.up.toArray();
    const from = { eye: camera.position.toArray(), target: controls.target.toArray(), up, fov_y: camera.fov };
    this.release();
    this.journey = { path: new Flight(from, { ...to, up }), seconds: isCalm() ? Infinity : 0, land };
    this.changed = true;
    if (isCalm()) this.travel(this.journey, 0);
  }

  private travel(journey: Journey, step: number): void {
    journey.seconds += step;
    this.stand(journey.path.at(journey.seconds));
    this.changed = true;
    if (!journey.path.isOver(journey.seconds)) return;
    this.journey = null;
    journey.land();
  }

  /** The visitor does something: a flight ends where it is. */
  private interrupt(): void {
    if (!this.journey) return;
    this.journey = null;
    this.limit(this.start());
  }

  /** Flies to what is at a place of the picture, or back where that is nobody, or near already. */
  private focus(at: Place): void {
    this.interrupt();
    const { camera, controls, bounds } = this;
    const point = bounds && this.touched(at, bounds.spine);
    const distance = controls.getDistance();
    if (!point || distance < ROOM * bounds.nearest) return this.show(this.subject.home);
    const back = camera.position.clone().sub(controls.target).setLength(Math.max(bounds.nearest, FOCUS * distance));
    const eye = point.clone().add(back);
    confine(eye, point, bounds, this.lens());
    this.setMoved(true);
    const up = camera.up.toArray();
    this.fly({ eye: eye.toArray(), target: point.toArray(), up, fov_y: camera.fov }, () => this.limit(this.start()));
  }

  /** The point of somebody that is at a place of the picture, as far away as the spine is; null if that is nobody. */
  private touched(at: Place, spine: THREE.Line3): THREE.Vector3 | null {
    const { position } = this.camera;
    const ray = new THREE.Ray(position, this.under(at).sub(position).normalize());
    const point = new THREE.Vector3();
    const nearest = new THREE.Vector3();
    const apart = Math.sqrt(ray.distanceSqToSegment(spine.start, spine.end, point, nearest));
    const isBesideHead = this.bounds?.eyes && nearest.distanceTo(spine.end) < HEAD;
    return apart < (isBesideHead ? HEAD : BESIDE) ? point : null;
  }

  private setMoved(moved: boolean): void {
    this.moved = moved;
    this.onView(this.view);
  }

  /** Turning is the library's; it zooms beside the pointer, so that zooming is done here. */
  private control(canvas: HTMLCanvasElement, onChange: () => void): OrbitControls {
    const controls = new OrbitControls(this.camera, canvas);
    controls.enableZoom = controls.enablePan = false;
    controls.touches.TWO = null;
    controls.addEventListener('start', () => this.interrupt());
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
    controls.enableDamping = !isCalm();
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
    const { theta, phi } = directionOf(start);
    controls.minAzimuthAngle = theta - sideways;
    controls.maxAzimuthAngle = theta + sideways;
    controls.minPolarAngle = phi - UPWARDS;
    controls.maxPolarAngle = phi + UPWARDS;
  }

  /** The visitor moved the camera: it stays where there is somebody to see. */
  private confine(): void {
    const { camera, controls, bounds } = this;
    if (!bounds) return;
    if (!this.moved) this.setMoved(true);
    confine(camera.position, controls.target, bounds, this.lens());
    camera.updateMatrixWorld();
  }

  private lens(): Lens {
    const { fov, aspect, up } = this.camera;
    return { slope: Math.tan(THREE.MathUtils.degToRad(fov) / 2), aspect, free: this.picture.free, up };
  }

  private key(event: KeyboardEvent): void {
    const moves: Record<CameraKey, () => void> = {
      ArrowLeft: () => this.turn(this.camera.up, KEY_STEP),
      ArrowRight: () => this.turn(this.camera.up, -KEY_STEP),
      ArrowUp: () => this.turn(this.right(), -KEY_STEP),
      ArrowDown: () => this.turn(this.right(), KEY_STEP),
      '+': () => this.zoom(this.centre(), 1 / KEY_ZOOM),
      '-': () => this.zoom(this.centre(), KEY_ZOOM),
      Home: () => this.show(this.subject.home),
    };
    const move = moves[event.key as CameraKey] as (() => void) | undefined;
    if (!move) return;
    event.preventDefault();
    this.interrupt();
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
    this.interrupt();
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
    this.interrupt();
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

/** Whether the visitor wants little motion. */
function isCalm(): boolean {
  return matchMedia('(prefers-reduced-motion: reduce)').matches;
}
