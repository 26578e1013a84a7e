import { Quaternion, Vector3, type Object3D } from 'three';
import type { GazeInfo } from '../../bundle/manifest.ts';
import { smooth } from '../../face/idle.ts';
import type { Looker } from '../../head/head.ts';
import { clamp } from '../../motion/glide.ts';
import type { StateMessage } from '../../protocol.ts';
import { Attention } from './attention.ts';
import { directionTo } from './gaze.ts';

const RADIANS = Math.PI / 180;
const JUMP = 0.05; // s in which eyes go from one point to the next
const LOOKS = [-0.032, 0, 0.032]; // m to the side: the eyes of who is looked at, and the mouth between them
const MOUTH = 0.07; // m under the eyes
const HOLDS = [0.5, 1.8]; // s for which eyes stay at a point, least and most
const AWAY = { side: [6 * RADIANS, 11 * RADIANS], down: [-2 * RADIANS, 4 * RADIANS], holds: [0.5, 1.1] }; // a look past somebody
/** How often the next point is past the visitor: who speaks looks away more than who listens. */
const PAST: Record<StateMessage['state'], number> = { speaking: 0.22, thinking: 0, listening: 0.04, idle: 0.06 };
const LEAST = 0.02 * RADIANS; // a turn that is not seen

/** Where the eyes look beside the visitor's own, radians: to the person's left, and downwards. */
type Beside = readonly [number, number];

/**
 * Turns the eyes of a head as people turn theirs: they hold the visitor while the head moves, go in jumps between
 * the visitor's eyes and mouth, look past them now and then, and lead where the head follows.
 */
export class EyeMovement implements Looker {
  private readonly gaze: GazeInfo;
  private readonly visitor: () => Vector3;
  private readonly attention: Attention;
  private readonly random: () => number;
  private state: StateMessage['state'] = 'idle';
  private now = 0; // s
  private jumped = -Infinity; // s, when the latest jump began
  private next = 0; // s, when the next one will
  private from: Beside = [0, 0];
  private to: Beside = [0, 0];
  private shown: Beside = [0, 0];

  /**
   * @param visitor returns the place of the visitor's eyes, m in the world
   * @param seed whole number that decides on sides while the person thinks, as that of a body's language does
   */
  constructor(gaze: GazeInfo, visitor: () => Vector3, seed: number, random: () => number = Math.random) {
    this.gaze = gaze;
    this.visitor = visitor;
    this.attention = new Attention(seed);
    this.random = random;
  }

  /** From now on the person listens, thinks, speaks, or does none of it. */
  attend(state: StateMessage['state']): void {
    this.attention.attend(state, this.now);
    this.state = state;
  }

  /**
   * How the eyes are turned `step` seconds later, in a head that is placed so: radians to the person's left, and
   * downwards; null if that is as before.
   */
  turn(step: number, { position, quaternion }: Pick<Object3D, 'position' | 'quaternion'>): Beside | null {
    this.now += step;
    const seen = this.visitor().clone().sub(position).applyQuaternion(new Quaternion().copy(quaternion).invert());
    const eyes = new Vector3(...this.gaze.eyes);
    if (this.now >= this.next) this.jump(seen.distanceTo(eyes));
    const [yaw, pitch] = directionTo(this.gaze.eyes, seen.toArray());
    const past = this.attention.at(this.now);
    const [aside, down] = this.beside();
    const [sides, up] = this.gaze.most;
    const turned: Beside = [clamp(yaw + aside + past.yaw, -sides, sides), clamp(pitch + down + past.pitch, -up, up)];
    if (turned.every((angle, i) => Math.abs(angle - this.shown[i]!) < LEAST)) return null;
    return (this.shown = turned);
  }

  private beside(): Beside {
    const done = smooth((this.now - this.jumped) / JUMP);
    const along = (i: 0 | 1) => this.from[i] + done * (this.to[i] - this.from[i]);
    return [along(0), along(1)];
  }

  /** Goes to another point of a face so many metres away, or past it. */
  private jump(distance: number): void {
    this.from = this.beside();
    const away = this.random() < PAST[this.state];
    this.to = away ? this.past() : this.pointOf(distance);
    this.jumped = this.now;
    this.next = this.now + this.between(away ? AWAY.holds : HOLDS);
  }

  private past(): Beside {
    const side = this.random() < 0.5 ? -1 : 1;
    return [side * this.between(AWAY.side), this.between(AWAY.down)];
  }

  private pointOf(distance: number): Beside {
    const aside = LOOKS[Math.floor(LOOKS.length * this.random())]!;
    return [Math.atan2(aside, distance), aside ? 0 : Math.atan2(MOUTH, distance)];
  }

  private between([least, most]: readonly number[]): number {
    return least! + (most! - least!) * this.random();
  }
}
