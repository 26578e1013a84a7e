import type { Actor } from '../../actor.ts';
import type { Motion, Seen } from '../../motion/motion.ts';
import { Growth } from '../../gaussians/growth.ts';
import type { BakedSkinned, SkinnedRows } from './baked.ts';
import { SkinnedGenerator } from './generator.ts';
import type { Pose } from './skeleton.ts';

/** A body on a skeleton on stage: it repeats the recorded motion, or takes any pose. */
export class SkinnedBody implements Actor {
  readonly generator: SkinnedGenerator;
  readonly objects: SkinnedGenerator[];
  readonly motion: Motion;
  /** What the next picture shows; nothing has to be loaded, so it never waits. */
  readonly shown: Seen = { time: 0, waiting: false };
  private readonly fps: number;
  private readonly pose: Pose;
  private readonly growth: Growth;
  private joints: Float32Array | null = null; // positions in the pose, where they were asked for
  private posing = false; // whether a pose was given by `strike`

  constructor(baked: BakedSkinned, motion: Motion) {
    this.motion = motion;
    this.fps = baked.info.fps;
    this.growth = new Growth(baked.info.num_rest === 0);
    this.generator = new SkinnedGenerator(baked);
    this.objects = [this.generator];
    this.pose = this.generator.skeleton.empty();
    this.replay();
  }

  /** Time of the recording that the picture shows, s. */
  get time(): number {
    return this.shown.time;
  }

  tick(step: number): boolean {
    this.motion.advance(step, this.shown);
    const grown = this.growth.advance(step);
    if (grown !== null) this.generator.grow(grown);
    if (this.posing || this.motion.time === this.shown.time) return grown !== null;
    this.replay();
    return true;
  }

  /** Positions (P,3) of joints and soles. */
  get points(): Float32Array {
    return (this.joints ??= this.generator.places());
  }

  /** Whether all of its Gaussians have come. */
  get whole(): boolean {
    return this.growth.hasBegun;
  }

  /** Shows, little by little, the Gaussians that came after the first ones. */
  refine(rest: SkinnedRows): void {
    this.generator.complete(rest);
    this.growth.begin();
  }

  /**
   * Takes any pose, and keeps it until `show` or `release`.
   *
   * @param rotations (J,4) local rotation of each joint, wxyz
   * @param root (3,) translation of the root from rest, metres
   */
  strike(rotations: ArrayLike<number>, root: ArrayLike<number>): void {
    this.posing = true;
    this.pose.rotations.set(rotations);
    this.pose.root.set(root);
    this.generator.skeleton.interpolate(this.pose);
    this.showPose();
  }

  limit(share: number): void {
    this.generator.limit(Math.ceil(share * this.generator.numSplats));
  }

  /** Continues with the recorded motion. */
  release(): void {
    this.posing = false;
    this.replay();
  }

  /** Resolves at once, as nothing has to be loaded. */
  async ready(): Promise<void> {}

  /** Goes to a time of the recording and stays there. */
  async show(seconds: number): Promise<void> {
    this.motion.hold(seconds);
    this.release();
  }

  private replay(): void {
    this.shown.time = this.motion.time;
    this.generator.skeleton.recorded(this.shown.time * this.fps, this.pose);
    this.showPose();
  }

  private showPose(): void {
    this.generator.pose(this.pose);
    this.joints = null;
  }
}
