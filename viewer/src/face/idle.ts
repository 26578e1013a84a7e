const CLOSING = 0.07; // s
const CLOSED = 0.04;
const OPENING = 0.15;
const PAUSES = [2, 6] as const; // s between blinks
const BLINK_LENGTH = CLOSING + CLOSED + OPENING;

/** The resting face: the neutral expression, and a blink now and then. */
export class IdleFace {
  private readonly neutral: Float32Array;
  private readonly lids: number[];
  private readonly random: () => number;
  private nextBlink = 1;

  /**
   * @param neutral (B,) expression with open eyes
   * @param lids indices of the eyelid values in it
   */
  constructor(neutral: Float32Array, lids: number[], random: () => number = Math.random) {
    this.neutral = neutral;
    this.lids = lids;
    this.random = random;
  }

  /** The expression at a time that only runs forward. */
  at(seconds: number, out: Float32Array): void {
    if (seconds > this.nextBlink + BLINK_LENGTH) {
      this.nextBlink = seconds + PAUSES[0] + (PAUSES[1] - PAUSES[0]) * this.random();
    }
    const closed = lidClosure(seconds - this.nextBlink);
    out.set(this.neutral);
    for (const i of this.lids) out[i] = this.neutral[i]! + (1 - this.neutral[i]!) * closed;
  }
}

/** How far the lids are closed, 0 to 1, `seconds` after a blink began. */
export function lidClosure(seconds: number): number {
  if (seconds <= 0 || seconds >= BLINK_LENGTH) return 0;
  if (seconds < CLOSING) return smooth(seconds / CLOSING);
  return 1 - smooth(Math.max(0, seconds - CLOSING - CLOSED) / OPENING);
}

/** Eases from 0 to 1 with no jump in speed. */
export function smooth(x: number): number {
  const t = Math.min(Math.max(x, 0), 1);
  return t * t * (3 - 2 * t);
}
