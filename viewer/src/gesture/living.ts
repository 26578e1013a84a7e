import { fromRotvec, multiply, scaled, type Quat, type Vector } from '../rig/quaternions.ts';
import type { Figure } from './figure.ts';
import { wander } from './noise.ts';
import { indexOf, SIDES, type Role } from './roles.ts';
import { stand } from './standing.ts';
import { about } from './turning.ts';

const RADIANS = Math.PI / 180;
const BREATH = 4.1; // duration of a breath, s
const WEIGHT = 9.7; // period of the quickest of the sines that shift the weight, s
const SHIFT = 0.02; // displacement of the hips to each side, relative to the person's height
const DROP = 0.0075; // how far the hips sink with the weight on one leg, relative to height
const SWAY = 0.003; // displacement of the hips forwards and back, relative to height
/** Angles by which a breath turns chest, head and collarbones. */
const BREATHING = { chest: -1.1 * RADIANS, head: 0.9 * RADIANS, clavicles: 1.0 * RADIANS };
const [LEFTWARDS, DOWN, FORWARD, HINGE]: Vector[] = [[1, 0, 0], [0, -1, 0], [0, 0, 1], [-1, 0, 0]];

/** The pose of a whole body at a moment. */
export interface Moment {
  pose: Quat[]; // local rotations by role, from the standard pose
  root: Vector; // translation of the root from rest, m
}

/** The living rest: a person breathes and shifts the weight while the feet stay; `docs/motion.md` defines it. */
export class Living {
  readonly figure: Figure;
  private readonly seed: number;

  /** @param seed whole number, seed of all random movements */
  constructor(figure: Figure, seed: number) {
    this.figure = figure;
    this.seed = seed;
  }

  /** Pose of the person at rest at a time, s. */
  at(time: number): Moment {
    const { height, sink } = this.figure;
    const pose = [...this.figure.hung];
    const breath = this.breath(time);
    const shifted = this.wander(time, WEIGHT, 1);
    const weight = (3.2 * shifted) / Math.sqrt(1 + 9 * shifted * shifted); // stays longer on one leg
    this.turnTorso(time, breath, weight, pose);
    this.swingArms(time, breath, pose);
    const root: Vector = [
      SHIFT * height * weight,
      -sink - DROP * height * weight * weight,
      SWAY * height * this.wander(time, 5.3, 2),
    ];
    stand(this.figure, root, pose);
    return { pose, root };
  }

  /** State of the breath at a time, from -1 (out) to 1 (in). */
  private breath(time: number): number {
    const phase = (2 * Math.PI * time) / BREATH + 0.9 * this.wander(time, 13.1, 0);
    return Math.sin(phase + 0.35 * Math.sin(phase));
  }

  private wander(time: number, period: number, channel: number): number {
    return wander(time, period, this.seed, channel);
  }

  /** The rotation vector `from`, in radians, plus random coordinates of up to `degrees`. */
  private about(from: Vector, time: number, period: number, channel: number, degrees: Vector): Vector {
    const along = (i: number) => from[i]! + this.wander(time, period, channel + i) * degrees[i]! * RADIANS;
    return [along(0), along(1), along(2)];
  }

  private turnTorso(time: number, breath: number, weight: number, pose: Quat[]): void {
    const roll = 5.0 * RADIANS * weight;
    const head = this.about([BREATHING.head * breath, 0, 0.4 * roll], time, 5.9, 16, [1.3, 2.2, 1.0]);
    const turns: [Role, Vector][] = [
      ['hips', this.about([0, 0, roll], time, 12.7, 10, [0.5, 1.2, 0.2])],
      ['spine', [0, 0, -0.9 * roll]],
      ['chest', this.about([BREATHING.chest * breath, 0, -0.5 * roll], time, 8.9, 13, [0.5, 0.9, 0.4])],
      ['neck', scaled(head, 0.5)],
      ['head', scaled(head, 0.5)],
    ];
    for (const [role, turn] of turns) pose[indexOf(role)] = fromRotvec(turn);
  }

  private swingArms(time: number, breath: number, pose: Quat[]): void {
    for (const [number, side] of SIDES.entries()) {
      const channel = 20 + 10 * number;
      const sign = side === 'left' ? 1 : -1;
      const wave = (period: number, offset: number) => this.wander(time, period, channel + offset);
      pose[indexOf(`${side}_clavicle`)] = about(FORWARD!, sign * BREATHING.clavicles * (0.5 + 0.5 * breath));
      const away = about(FORWARD!, sign * 1.2 * RADIANS * (0.5 + 0.5 * wave(9.1, 1)));
      const turns: [Role, Quat][] = [
        [`${side}_shoulder`, multiply(away, about(LEFTWARDS!, 1.5 * RADIANS * wave(7.3, 0)))],
        [`${side}_elbow`, about(HINGE!, 3.0 * RADIANS * wave(6.1, 2))],
        [`${side}_wrist`, about(DOWN!, sign * 7.0 * RADIANS * wave(8.3, 3))],
      ];
      for (const [role, turn] of turns) pose[indexOf(role)] = multiply(turn, pose[indexOf(role)]!);
    }
  }
}
