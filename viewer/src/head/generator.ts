import type { BakedHead, HeadRows } from '../bundle/baked-head.ts';
import { Generator } from '../gaussians/generator.ts';
import { coefficients } from './coefficients.ts';
import { SoftHead } from './soft.ts';

/** The head as a generator: Gaussians from a baked basis and K coefficients. */
export class HeadGenerator extends Generator {
  /** The first Gaussians, and those that came later. */
  readonly parts: HeadRows[];
  /** Coefficients of the expression shown, (K,). */
  readonly shown: Float32Array;
  /** Share of their opacity that Gaussians have which came later. */
  grown = 0;
  readonly soft: SoftHead;
  private readonly network: BakedHead['network'];

  /** @param capacity number of all its Gaussians, of which `head` may have the first only */
  constructor(head: BakedHead, capacity = head.count) {
    super(capacity);
    this.parts = [head];
    this.shown = new Float32Array(head.rank);
    this.soft = new SoftHead(this);
    this.network = head.network;
  }

  /** Takes the Gaussians that come after the first ones; they are not seen until `grow`. */
  complete(rest: HeadRows): void {
    this.parts.push(rest);
    this.changed();
  }

  /** Shows the Gaussians that came later with a share of their opacity. */
  grow(share: number): void {
    this.grown = share;
    this.changed();
  }

  /** Shows an expression (B,) from the next frame on. */
  express(expression: Float32Array): void {
    coefficients(this.network, expression, this.shown);
    this.changed();
  }
}
