import type { HeadFiles } from '../bundle/load.ts';
import type { Actor } from '../stage/stage.ts';
import { HeadGenerator } from './generator.ts';
import { PoseLoop } from './poses.ts';

/** What the face shows, decided anew each tick. */
export interface Director {
  /** Writes the expression (B,) to show now; returns false if it is as before. */
  expression(out: Float32Array): boolean;
}

/** The head on stage: it shows what its director decides and sways as it was captured. */
export class Head implements Actor {
  readonly generator: HeadGenerator;
  readonly objects: HeadGenerator[];
  readonly expression: Float32Array;
  director: Director | null = null;
  bodyTime = 0; // s along the captured motion
  private readonly moving: boolean;
  private readonly poses: PoseLoop;

  /** @param moving the head follows the captured motion */
  constructor({ info, baked, poses }: HeadFiles, moving: boolean) {
    this.moving = moving;
    this.generator = new HeadGenerator(baked);
    this.objects = [this.generator];
    this.poses = new PoseLoop(poses, info.fps);
    this.expression = Float32Array.from(info.idle_expression);
    this.show(this.expression);
  }

  /** Shows one expression, with the head where it is at a time. */
  show(expression: ArrayLike<number>, poseSeconds = 0): void {
    this.poses.apply(poseSeconds, this.generator);
    this.expression.set(expression);
    this.generator.express(this.expression);
  }

  tick(step: number): boolean {
    if (this.moving) {
      this.bodyTime += step;
      this.poses.apply(this.bodyTime, this.generator);
    }
    const changed = this.director?.expression(this.expression) ?? false;
    if (changed) this.generator.express(this.expression);
    return changed || this.moving;
  }
}
