import * as THREE from 'three';
import type { Ground } from '../stage/camera/ground.ts';

export const APART = 1.2; // m between those who talk, at first
const NEAREST = 0.8; // m between a visitor and the middle of somebody
const FARTHEST = 8; // m
const CLOSE = 0.05; // m from the eyes from which on something is drawn
const FAR = 100; // m

const BESIDE = Math.PI / 4; // rad: who is farther aside is hardly seen

/**
 * The headset's own space in the world, where y is up and the floor is at 0: whatever is tracked is
 * in it. It is as large as the world, so people are seen in life size.
 */
export class Rig extends THREE.Group {
  readonly camera = new THREE.PerspectiveCamera(60, 1, CLOSE, FAR);
  private readonly ground: Ground;
  private readonly anchor: THREE.Vector3; // on the floor, under the eyes of who is met
  private readonly facing: THREE.Quaternion; // of a space whose z axis is where that person faces

  constructor(ground: Ground, eyes: THREE.Vector3) {
    super();
    this.ground = ground;
    this.anchor = onFloor(eyes, ground);
    const { up, toward } = ground;
    const right = up.clone().cross(toward);
    this.facing = new THREE.Quaternion().setFromRotationMatrix(new THREE.Matrix4().makeBasis(right, up, toward));
    this.add(this.camera);
  }

  /**
   * Lets the person stand at a place of the headset's space, turned to the visitor.
   *
   * @param spot on the floor, m in the headset's space
   * @param head of the visitor, m in the headset's space
   */
  meet(spot: THREE.Vector3, head: THREE.Vector3): void {
    const turn = Math.atan2(head.x - spot.x, head.z - spot.z);
    this.quaternion.copy(this.facing).multiply(new THREE.Quaternion().setFromAxisAngle(new THREE.Vector3(0, 1, 0), -turn));
    const place = new THREE.Vector3(spot.x, 0, spot.z).applyQuaternion(this.quaternion);
    this.position.copy(this.anchor).sub(place);
    this.updateMatrixWorld(true);
  }

  /**
   * Takes the visitor to a place on the floor, which stays beside the person and in sight of them.
   * Where the person would be out of the visitor's sight, the visitor is turned to them.
   *
   * @param place m in the world
   * @param head of the visitor, m in the headset's space
   * @param ahead where the visitor looks, in the headset's space
   */
  go(place: THREE.Vector3, head: THREE.Vector3, ahead: THREE.Vector3): void {
    const way = onFloor(place, this.ground).sub(this.anchor);
    const goal = this.anchor.clone().add(way.clampLength(NEAREST, FARTHEST));
    this.position.add(goal.sub(this.under(head)));
    this.updateMatrixWorld(true);
    const aside = this.aside(head, ahead);
    if (Math.abs(aside) > BESIDE) this.turn(aside, head);
  }

  /**
   * How far aside of where the visitor looks the person is, rad, positive to the left.
   *
   * @param head of the visitor, m in the headset's space
   * @param ahead where the visitor looks, in the headset's space
   */
  aside(head: THREE.Vector3, ahead: THREE.Vector3): number {
    const { up } = this.ground;
    const way = this.anchor.clone().sub(this.under(head));
    const look = ahead.clone().applyQuaternion(this.quaternion).projectOnPlane(up);
    return Math.atan2(look.clone().cross(way).dot(up), look.dot(way));
  }

  /**
   * Turns the visitor around themselves.
   *
   * @param angle rad, to the left
   * @param head of the visitor, m in the headset's space
   */
  turn(angle: number, head: THREE.Vector3): void {
    const before = this.under(head);
    this.quaternion.premultiply(new THREE.Quaternion().setFromAxisAngle(this.ground.up, angle));
    this.updateMatrixWorld(true);
    this.position.add(before.sub(this.under(head)));
    this.updateMatrixWorld(true);
  }

  /** The place on the world's floor under a point of the headset's space. */
  private under(point: THREE.Vector3): THREE.Vector3 {
    return onFloor(this.localToWorld(point.clone()), this.ground);
  }
}

/** The place on the floor under a point of the world. */
function onFloor(point: THREE.Vector3, { foot, up }: Ground): THREE.Vector3 {
  return point.clone().addScaledVector(up, foot.clone().sub(point).dot(up));
}
