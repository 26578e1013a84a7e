/** How much may come: so much at once, and so much per second for long. */
export class Allowance {
  private readonly rate: number;
  private readonly burst: number;
  private level: number;
  private at = performance.now();

  /**
   * @param burst at once
   * @param rate per second
   */
  constructor(burst: number, rate: number) {
    this.rate = rate;
    this.burst = this.level = burst;
  }

  /** Takes an amount, if there is as much; returns whether there was. */
  take(amount: number): boolean {
    const now = performance.now();
    this.level = Math.min(this.burst, this.level + (this.rate * (now - this.at)) / 1000);
    this.at = now;
    if (amount > this.level) return false;
    this.level -= amount;
    return true;
  }
}
