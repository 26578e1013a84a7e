import type { BakedHead, HeadRows } from '../bundle/baked-head.ts';
import { GrowingGenerator } from '../gaussians/growing.ts';
import { EYE_UNIT } from '../shared.ts';
import { coefficients } from './coefficients.ts';
import { MOTION_SIZE, STILL } from './shoulders.ts';
import { SoftHead, type ShownRows } from './soft.ts';

/** The head as a generator: Gaussians from a baked basis and K coefficients. */
export class HeadGenerator extends GrowingGenerator {
  /** The first Gaussians, and those that came later. */
  readonly parts: ShownRows[];
  /** Coefficients of the expression shown (K,), its steps (M,), and the motion of the shoulders (7,). */
  readonly values: Float32Array;
  readonly shown: Float32Array;
  /** Metres of a unit of each displacement. */
  readonly steps: Float32Array;
  /** How the shoulders have moved against the head: rotation wxyz, shift. */
  readonly bent: Float32Array;
  readonly soft: SoftHead;
  private readonly network: BakedHead['network'];
  private readonly moving: BakedHead['moving'];
  private readonly share: Uint8Array;
  private eyes: [number, number] | null = null; // as they are turned

  /**
   * @param capacity number of all its Gaussians, of which `head` may have the first only
   * @param share (capacity,) how much each moves with the shoulders, of 255
   */
  constructor(head: BakedHead, capacity = head.count, share: Uint8Array = new Uint8Array(capacity)) {
    super(capacity, head.count);
    this.share = share;
    this.parts = [{ ...head, share: share.subarray(0, head.count) }];
    const moved = head.rank + head.moves;
    this.values = new Float32Array(moved + MOTION_SIZE);
    this.shown = this.values.subarray(0, head.rank);
    this.steps = this.values.subarray(head.rank, moved);
    this.bent = this.values.subarray(moved);
    this.bent.set(STILL);
    this.soft = new SoftHead(this);
    this.network = head.network;
    this.moving = head.moving;
  }

  /** Takes the Gaussians that come after the first ones; they are not seen until `grow`. */
  complete(rest: HeadRows): void {
    const first = this.parts[0]!.count;
    this.parts.push({ ...rest, share: this.share.subarray(first, first + rest.count) });
    this.changed();
  }

  /** Moves the shoulders against the head: rotation wxyz with w ≥ 0, and shift in metres. */
  bend(motion: Float32Array): void {
    this.bent.set(motion);
    this.changed();
  }

  /** Shows an expression (B,) from the next frame on. */
  express(expression: Float32Array): void {
    coefficients(this.network, expression, this.shown);
    coefficients(this.moving, expression, this.steps);
    if (this.eyes) this.look(...this.eyes);
    this.changed();
  }

  /** Turns the eyes, of a head whose last two displacements do so: radians to the person's left, and downwards. */
  look(yaw: number, pitch: number): void {
    this.eyes = [yaw, pitch];
    this.steps.set([EYE_UNIT * yaw, EYE_UNIT * pitch], this.steps.length - 2);
    this.changed();
  }
}
