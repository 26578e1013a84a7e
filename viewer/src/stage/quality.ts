/** What is drawn of everything: shares of the best, which is 1. */
export interface Level {
  backdrop: number; // Gaussians behind the person, the largest ones first
  pixels: number; // along a side
  gaussians: number; // of the person, the most important ones first
}

/** What may be drawn less. */
export interface Savings {
  backdrop: boolean;
  gaussians: boolean;
}

const LEAST = 28.5; // pictures/s: 30 but for jitter
const SLOW = 0.7; // of the least rate: under it, two steps are taken at once
const AMPLE = 1.58; // of the least rate: from it on, a better picture is tried
const NEARLY = 0.95; // of the best rate that was ever seen: a screen may be no faster
const WINDOW = 1; // s of pictures that are judged together
const SETTLING = 2; // windows after a change, or the start, that are not judged
const WAIT = 4; // s of ample speed before a better picture is tried
const LONGEST_WAIT = 128; // s, after tries that failed
const TRIAL = 10; // s in which a better picture must not have been too slow

/** From the best picture to the cheapest: first the backdrop goes, then pixels, then Gaussians of the person. */
export function ladder({ backdrop, gaussians }: Savings): Level[] {
  const best: Level = { backdrop: 1, pixels: 1, gaussians: 1 };
  const behind: Partial<Level>[] = backdrop ? [{ backdrop: 0.5 }, { backdrop: 0.2 }] : [];
  const fewer: Partial<Level>[] = gaussians ? [{ gaussians: 0.7 }, { gaussians: 0.45 }] : [];
  const steps = [...behind, { pixels: 0.8 }, { pixels: 0.65 }, ...fewer, { pixels: 0.5 }];
  return steps.reduce<Level[]>((levels, step) => [...levels, { ...levels.at(-1)!, ...step }], [best]);
}

/**
 * Chooses what is drawn so that at least 30 pictures per second are, in headsets more.
 *
 * It goes down after two slow seconds, up after some of ample speed. A better picture that turns out
 * too slow makes it wait twice as long before the next try, so that it does not go to and fro.
 */
export class Quality {
  /** Index into the levels, 0 the best. */
  index = 0;
  private levels: readonly Level[];
  private isHeld = false;
  private readonly steps: number[] = []; // s, of this window
  private settling = SETTLING; // windows
  private slowBefore = false; // whether the window before was too slow
  private ample = 0; // s
  private wait = WAIT;
  private sinceRise = Infinity; // s
  private fastest = 0; // pictures/s
  private least = LEAST; // pictures/s

  constructor(levels: readonly Level[]) {
    this.levels = levels;
  }

  get level(): Level {
    return this.levels[this.index]!;
  }

  get count(): number {
    return this.levels.length;
  }

  /** Keeps to a level whatever it costs: for measurements. */
  hold(index: number): void {
    this.index = index;
    this.isHeld = true;
  }

  /** What can be saved has changed: begins with the best picture again. */
  reset(levels: readonly Level[]): void {
    this.levels = levels;
    if (!this.isHeld) this.index = 0;
    this.rest();
  }

  /** Pictures go to another screen from now on, on which so many per second are needed at least; by default to the page. */
  aim(least = LEAST): void {
    this.least = least;
    this.fastest = 0;
    this.wait = WAIT;
    this.rest();
  }

  /** There are no pictures for a while: what came before does not count. */
  rest(): void {
    this.steps.length = 0;
    this.settling = SETTLING;
    this.slowBefore = false;
    this.ample = 0;
  }

  /**
   * A picture was drawn.
   *
   * @param step seconds that it took
   * @returns whether another level is to be drawn from now on
   */
  picture(step: number): boolean {
    if (this.isHeld) return false;
    this.steps.push(step);
    const time = this.steps.reduce((sum, one) => sum + one, 0);
    if (time < WINDOW) return false;
    const rate = rateOf(this.steps, time);
    this.steps.length = 0;
    this.sinceRise += time;
    if (this.settling > 0) {
      this.settling--;
      return false;
    }
    return this.judge(rate, time);
  }

  private judge(rate: number, time: number): boolean {
    this.fastest = Math.max(this.fastest, rate);
    const slow = rate < this.least;
    const verySlow = rate < SLOW * this.least;
    const surely = slow && (this.slowBefore || verySlow);
    this.slowBefore = slow;
    if (surely) return this.fall(verySlow ? 2 : 1);
    this.ample = !slow && rate >= Math.min(AMPLE * this.least, NEARLY * this.fastest) ? this.ample + time : 0;
    return this.ample >= this.wait && this.rise();
  }

  private fall(steps: number): boolean {
    if (this.sinceRise < TRIAL) this.wait = Math.min(LONGEST_WAIT, 2 * this.wait);
    this.sinceRise = Infinity;
    return this.go(Math.min(this.levels.length - 1, this.index + steps));
  }

  private rise(): boolean {
    if (this.sinceRise >= TRIAL && this.sinceRise < Infinity) this.wait = WAIT; // the last try held
    this.sinceRise = 0;
    return this.go(Math.max(0, this.index - 1));
  }

  private go(index: number): boolean {
    if (index === this.index) return false;
    this.index = index;
    this.rest();
    return true;
  }
}

/** Pictures per second, without the longest one: programs are compiled, memory is tidied. */
function rateOf(steps: readonly number[], time: number): number {
  return steps.length < 4 ? steps.length / time : (steps.length - 1) / (time - Math.max(...steps));
}
