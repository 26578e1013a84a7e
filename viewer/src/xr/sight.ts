import type { Vector3 } from 'three';

const UNSEEN = Math.PI / 4; // rad aside: what is there is hardly seen
const LOST = 1.5; // s after which who is not seen is lost
const WHOLE = Math.PI / 9; // rad aside: up to here all of the board is in sight

/** How well the visitor sees the face, and so where the board is, which else stands below it. */
export class Sight {
  private aside = 0; // rad, of where the visitor looks, positive to the left
  private unseen = 0; // s
  private carried = false; // by a stick, and the board at the face was not in sight since

  /** The visitor was turned, or put elsewhere, at once: eyes that did not move do not look for the board. */
  carry(): void {
    this.carried = true;
  }

  /**
   * Lets time pass.
   *
   * @param step s since the last call
   * @param aside how far aside of where the visitor looks the face is, rad, positive to the left
   */
  pass(step: number, aside: number): void {
    this.aside = aside;
    this.unseen = Math.abs(aside) > UNSEEN ? this.unseen + step : 0;
    if (Math.abs(aside) <= WHOLE) this.carried = false;
  }

  /** Whether the visitor does not see the face, and has not for a while. */
  get isLost(): boolean {
    return this.unseen > LOST;
  }

  /** The place nearest to the face's, around the visitor, at which the board is in sight; changes `chin`. */
  nearest(chin: Vector3, visitor: Vector3, up: Vector3): Vector3 {
    if (!this.carried) return chin;
    const seen = Math.max(-WHOLE, Math.min(WHOLE, this.aside));
    return chin.sub(visitor).applyAxisAngle(up, seen - this.aside).add(visitor);
  }
}
