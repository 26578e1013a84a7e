const DURATION = 0.6; // s in which finer Gaussians appear

/** How far the Gaussians have appeared that came after the first ones. */
export class Growth {
  /** Whether they are there. */
  hasBegun: boolean;
  private share: number;

  /** @param whole there were none but the first ones */
  constructor(whole: boolean) {
    this.hasBegun = whole;
    this.share = whole ? 1 : 0;
  }

  /** They are there now. */
  begin(): void {
    this.hasBegun = true;
  }

  /** Goes on by some seconds; gives the share of their opacity that is to be shown from now on, or null if it is as before. */
  advance(step: number): number | null {
    if (!this.hasBegun || this.share === 1) return null;
    this.share = Math.min(1, this.share + step / DURATION);
    return this.share * this.share * (3 - 2 * this.share);
  }
}
