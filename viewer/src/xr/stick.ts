const FAR = 0.6; // of the way to the edge: from here on a stick is pushed
const BACK = 0.3; // under this it is let go

/** What a stick asks for now. */
export type Wish = 'aim' | 'go' | 'left' | 'right' | null;

/** A stick: forward aims, letting go goes there; each push to a side turns once. */
export class Stick {
  private aiming = false;
  private turned = false;

  /** @param axes to the right and backwards, −1 to 1 */
  read(x: number, y: number): Wish {
    if (this.aiming) {
      this.aiming = Math.hypot(x, y) > BACK;
      return this.aiming ? 'aim' : 'go';
    }
    if (this.turned) {
      this.turned = Math.abs(x) > BACK;
      return null;
    }
    if (-y > FAR && -y > Math.abs(x)) {
      this.aiming = true;
      return 'aim';
    }
    this.turned = Math.abs(x) > FAR;
    return this.turned ? (x < 0 ? 'left' : 'right') : null;
  }
}
