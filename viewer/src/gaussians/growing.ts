import { Generator } from './generator.ts';

const ENOUGH = 0.45; // share of the Gaussians that look like all of them
const WIDENING = 0.3; // exponent by which fewer are wider

/**
 * Gaussians on stage of which the most important ones come first, and the others appear later.
 *
 * While the first ones stand there alone they are wider: as they are they would leave holes, through
 * which one sees what is behind a neck or a chest.
 */
export abstract class GrowingGenerator extends Generator {
  /** Share of their opacity that Gaussians have which came later. */
  grown = 0;
  private readonly widest: number;

  /**
   * @param numSplats all Gaussians that there may be
   * @param first those that come first
   */
  constructor(numSplats: number, first: number) {
    super(numSplats);
    this.widest = widening(first / numSplats);
  }

  /** By how much the sizes of the first Gaussians are multiplied. */
  get wide(): number {
    return this.widest + this.grown * (1 - this.widest);
  }

  /** Shows the Gaussians that came later with a share of their opacity. */
  grow(share: number): void {
    this.grown = share;
    this.changed();
  }
}

/** By how much Gaussians are widened of which a share is there: what is most like all of them (docs/choices.md, "Bodies on a skeleton"). */
export function widening(share: number): number {
  return Math.max(1, (ENOUGH / share) ** WIDENING);
}
