import type { Actor } from '../../actor.ts';
import type { Motion, Seen } from '../../motion/motion.ts';
import type { BakedSkinned } from './baked.ts';
import { SkinnedGenerator } from './generator.ts';
import type { Pose } from './skeleton.ts';

/** A body on a skeleton on stage: it repeats what was recorded, or takes any pose. */
export class SkinnedBody implements Actor {
  readonly generator: SkinnedGenerator;
  readonly objects: SkinnedGenerator[];
  readonly motion: Motion;
  /** What the next picture shows; all of the body is there from the start. */
  readonly shown: Seen = { time: 0, waiting: false };
  private readonly fps: number;
  private readonly pose: Pose;
  private posing = false; // somebody else says how it stands

  constructor(baked: BakedSkinned, motion: Motion) {
    this.motion = motion;
    this.fps = baked.info.fps;
    this.generator = new SkinnedGenerator(baked);
    this.objects = [this.generator];
    this.pose = this.generator.skeleton.empty();
    this.replay();
  }

  /** The body time that is seen, s. */
  get time(): number {
    return this.shown.time;
  }

  tick(step: number): boolean {
    this.motion.advance(step, this.shown);
    if (this.posing || this.motion.time === this.shown.time) return false;
    this.replay();
    return true;
  }

  /**
   * Stands in a pose that need not have been recorded, until `show` or `release`.
   *
   * @param rotations (J,4) wxyz of each joint about itself
   * @param root (3,) metres that the root moves from rest
   */
  strike(rotations: ArrayLike<number>, root: ArrayLike<number>): void {
    this.posing = true;
    this.pose.rotations.set(rotations);
    this.pose.root.set(root);
    this.generator.skeleton.interpolate(this.pose);
    this.generator.pose(this.pose);
  }

  /** Goes on with what was recorded. */
  release(): void {
    this.posing = false;
    this.replay();
  }

  /** Nothing has to be waited for. */
  async ready(): Promise<void> {}

  /** Goes to a time of the recording and stays there. */
  async show(seconds: number): Promise<void> {
    this.motion.hold(seconds);
    this.release();
  }

  private replay(): void {
    this.shown.time = this.motion.time;
    this.generator.skeleton.recorded(this.shown.time * this.fps, this.pose);
    this.generator.pose(this.pose);
  }
}
