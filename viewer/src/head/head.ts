import { Quaternion, Vector3, type Object3D } from 'three';
import type { Actor } from '../actor.ts';
import type { HeadRows } from '../bundle/baked-head.ts';
import type { HeadFiles } from '../bundle/load.ts';
import type { HeadInfo } from '../bundle/manifest.ts';
import { Growth } from '../gaussians/growth.ts';
import type { Quat, Vector } from '../rig/quaternions.ts';
import { HeadGenerator } from './generator.ts';
import { backAndForth, Poses } from './poses.ts';
import { Shoulders } from './shoulders.ts';

/** What the face shows, decided anew each tick. */
export interface Director {
  /** Writes the expression (B,) to show now; returns false if it is as before. */
  expression(out: Float32Array): boolean;
}

/** Turns a head's eyes. */
export interface Looker {
  /** Radians to the person's left, and downwards, `step` seconds later in a head that is placed so; null if as before. */
  turn(step: number, placed: Pick<Object3D, 'position' | 'quaternion'>): readonly [number, number] | null;
}

/** Says, `step` seconds after it was asked last, at which row of its poses a head is. */
export type Carrier = (step: number) => number;

/** How far a head has moved rigidly from where its row has it: x goes to q·x + shift. */
export type RigidMotion = readonly [Quat, Vector];

/** A head alone sways as it was captured, back and forth for ever. */
export function sway({ fps, num_poses: count }: HeadInfo): Carrier {
  let seconds = 0;
  return (step) => backAndForth((seconds += step) * fps, count);
}

/** The head on stage: it shows what its director decides, where something carries it. */
export class Head implements Actor {
  readonly generator: HeadGenerator;
  readonly objects: HeadGenerator[];
  readonly expression: Float32Array;
  director: Director | null = null;
  /** Where its eyes look; null where they do not turn. */
  eyes: Looker | null = null;
  /** What moves it on from its row; null where its rows say all. */
  motion: (() => RigidMotion) | null = null;
  row = NaN; // of the poses, as shown
  private readonly carrier: Carrier;
  private readonly poses: Poses;
  private readonly shoulders: Shoulders | null;
  private readonly growth: Growth;

  constructor({ info, baked, poses, shoulders }: HeadFiles, carrier: Carrier) {
    this.carrier = carrier;
    this.generator = new HeadGenerator(baked, info.num_gaussians, shoulders?.share);
    this.shoulders = shoulders && new Shoulders(shoulders);
    this.objects = [this.generator];
    this.poses = new Poses(poses);
    this.expression = new Float32Array(info.expression_size);
    this.express(info.idle_expression);
    this.growth = new Growth(info.num_rest === 0);
    this.place(carrier(0));
  }

  /** Shows one expression. */
  express(expression: ArrayLike<number>): void {
    this.expression.set(expression);
    this.generator.express(this.expression);
  }

  /** Whether all of its Gaussians have come. */
  get whole(): boolean {
    return this.growth.hasBegun;
  }

  /** Shows, little by little, the Gaussians that came after the first ones. */
  refine(rest: HeadRows): void {
    this.generator.complete(rest);
    this.growth.begin();
  }

  /** Goes to a row of its poses. */
  place(row: number): void {
    this.row = row;
    this.poses.apply(row, this.generator);
    if (this.motion) move(this.generator, ...this.motion());
    if (this.shoulders) this.generator.bend(this.shoulders.motion(row, this.generator));
  }

  tick(step: number): boolean {
    const row = this.carrier(step);
    const moved = row !== this.row || this.motion !== null;
    if (moved) this.place(row);
    const changed = this.director?.expression(this.expression) ?? false;
    if (changed) this.generator.express(this.expression);
    const looked = this.eyes?.turn(step, this.generator) ?? null;
    if (looked) this.generator.look(...looked);
    const grown = this.growth.advance(step);
    if (grown !== null) this.generator.grow(grown);
    return changed || moved || looked !== null || grown !== null;
  }
}

function move({ position, quaternion }: Object3D, [w, x, y, z]: Quat, shift: Vector): void {
  const turn = new Quaternion(x, y, z, w);
  quaternion.premultiply(turn);
  position.applyQuaternion(turn).add(new Vector3(...shift));
}
