import { BLINK } from '../shared.ts';

const LENGTH = BLINK.closing + BLINK.closed + BLINK.opening; // s

/** How much of the way to closed a face may narrow its eyes by itself, as in a smile. */
const NARROWEST = 0.3;

/** The resting face: the neutral expression, and lids that blink at rest and in speech. */
export class IdleFace {
  private readonly neutral: Float32Array;
  private readonly lids: number[];
  private readonly random: () => number;
  private blink = 1; // s, when the latest or the next one begins

  /**
   * @param neutral (B,) expression with open eyes
   * @param lids indices of the eyelid values in it
   */
  constructor(neutral: Float32Array, lids: number[], random: () => number = Math.random) {
    this.neutral = neutral;
    this.lids = lids;
    this.random = random;
  }

  /** The expression at rest. */
  at(seconds: number, out: Float32Array): void {
    this.rest(out);
    this.blinks(seconds, out);
  }

  /** The expression at rest, between two blinks. */
  rest(out: Float32Array): void {
    out.set(this.neutral);
  }

  /**
   * Lets the lids of any expression blink: one series, whatever the face does besides, from open or narrowed eyes.
   *
   * @param seconds of a clock that only runs forward
   */
  blinks(seconds: number, out: Float32Array): void {
    while (seconds > this.blink + LENGTH) this.blink += this.pause();
    const closed = lidClosure(seconds - this.blink);
    for (const i of this.lids) {
      const open = this.neutral[i]!;
      const narrowed = Math.min(Math.max(out[i]!, open), open + NARROWEST * (1 - open));
      out[i] = narrowed + (1 - narrowed) * closed;
    }
  }

  /** Seconds from one blink to the next: log-normal, within bounds. */
  private pause(): number {
    const normal = Math.sqrt(-2 * Math.log(1 - this.random())) * Math.cos(2 * Math.PI * this.random());
    return Math.min(Math.max(BLINK.median * Math.exp(BLINK.spread * normal), BLINK.shortest), BLINK.longest);
  }
}

/** How far the lids are closed, 0 to 1, `seconds` after a blink began. */
export function lidClosure(seconds: number): number {
  return smooth(seconds / BLINK.closing) - smooth((seconds - BLINK.closing - BLINK.closed) / BLINK.opening);
}

/** Eases from 0 to 1 with no jump in speed. */
export function smooth(x: number): number {
  const t = Math.min(Math.max(x, 0), 1);
  return t * t * (3 - 2 * t);
}
