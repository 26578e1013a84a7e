import { clamp } from '../../motion/glide.ts';
import { multiply, subtract, type Quat, type Vector } from '../../rig/quaternions.ts';
import { about } from '../turning.ts';
import type { Bearing } from './attention.ts';

const RADIANS = Math.PI / 180;
const TICK = 0.01; // s of a simulation step; steps are fixed, so motion does not depend on the frame rate
const HEAD_YAW = 50 * RADIANS; // largest angle by which neck and head together turn against the chest
const HEAD_PITCH = 22 * RADIANS; // largest angle by which neck and head together nod
const CHEST_YAW = 24 * RADIANS; // largest angle by which the chest turns
const CHEST_FROM = 15 * RADIANS; // angle of the visitor above which the chest turns, too
const CHEST_PART = 0.4; // share of the angle beyond CHEST_FROM by which the chest turns
const FACE_SPEED = 140 * RADIANS; // largest speed in space per second
const CHEST_SPEED = 45 * RADIANS; // largest speed in space per second
const TILT_SPEED = 30 * RADIANS; // largest speed per second
const FACE_STIFF = 7; // natural frequency with which the face follows, 1/s
const CHEST_STIFF = 3; // natural frequency with which the chest follows, and the head tilts, 1/s
const BEHIND = 120 * RADIANS; // a visitor beyond this angle is behind: the person stays turned to the side of leaving
const STRAIGHT: Bearing = { yaw: 0, pitch: 0, tilt: 0 };

/** An angle that follows a target, critically damped and with limited speed. */
class Hinge {
  angle = 0;
  private speed = 0;
  private readonly stiff: number;
  private readonly fastest: number;

  constructor(stiff: number, fastest: number) {
    this.stiff = stiff;
    this.fastest = fastest;
  }

  step(target: number): void {
    const pull = this.stiff * this.stiff * (target - this.angle) - 2 * this.stiff * this.speed;
    const most = this.stiff * this.fastest;
    this.speed = clamp(this.speed + TICK * clamp(pull, -most, most), -this.fastest, this.fastest);
    this.angle += TICK * this.speed;
  }
}

/** Rotations of chest, neck and head towards the visitor, as far and as fast as people turn. */
export class Gaze {
  private steps = 0;
  private yaw = 0;
  private pitch = 0;
  private tilt = 0;
  private readonly chest = new Hinge(CHEST_STIFF, CHEST_SPEED);
  private readonly face = new Hinge(FACE_STIFF, FACE_SPEED);
  private readonly nod = new Hinge(FACE_STIFF, FACE_SPEED);
  private readonly lean = new Hinge(CHEST_STIFF, TILT_SPEED);

  /**
   * Sets the direction of the visitor, and how the head is held besides.
   *
   * @param yaw radians to the person's left
   * @param pitch radians downwards
   */
  look(yaw: number, pitch: number, besides: Bearing = STRAIGHT): void {
    const toward = Math.abs(yaw) <= BEHIND ? yaw : BEHIND * Math.sign(this.yaw || yaw);
    this.yaw = toward + besides.yaw;
    this.pitch = pitch + besides.pitch;
    this.tilt = besides.tilt;
  }

  /** Local rotations of chest, neck and head at a time, s; times must not descend from call to call. */
  at(time: number): [Quat, Quat, Quat] {
    for (; this.steps * TICK < time - 1e-9; this.steps++) this.step();
    const turned = this.face.angle - this.chest.angle;
    const half = multiply(about([0, 1, 0], 0.5 * turned), about([1, 0, 0], 0.5 * this.nod.angle));
    const held = multiply(half, about([0, 0, 1], -0.5 * this.lean.angle)); // about the way that the face looks
    return [about([0, 1, 0], this.chest.angle), held, held];
  }

  private step(): void {
    const beyond = Math.max(Math.abs(this.yaw) - CHEST_FROM, 0) * CHEST_PART;
    this.chest.step(Math.sign(this.yaw) * Math.min(beyond, CHEST_YAW));
    // The face, not the neck, follows: it stays on the visitor while the chest catches up.
    this.face.step(this.chest.angle + clamp(this.yaw - this.chest.angle, -HEAD_YAW, HEAD_YAW));
    this.nod.step(clamp(this.pitch, -HEAD_PITCH, HEAD_PITCH));
    this.lean.step(this.tilt);
  }
}

/** Direction from a point to a visitor, for a person facing +z: radians to the person's left, and downwards. */
export function directionTo(point: Vector, visitor: Vector): [number, number] {
  const [x, y, z] = subtract(visitor, point);
  return [Math.atan2(x, z), -Math.atan2(y, Math.sqrt(x * x + z * z))];
}
