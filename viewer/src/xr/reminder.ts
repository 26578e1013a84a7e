const QUIET = 60; // s without talk after which the visitor may have forgotten how it goes on
const SHOWN = 8; // s

/** Says after each quiet while, for some seconds, that the visitor is told again what the tools do. */
export class Reminder {
  private quiet = 0; // s

  /**
   * Lets time pass.
   *
   * @param step s since the last call
   * @param talks whether somebody talks, listens or thinks
   * @returns whether the visitor is reminded now
   */
  pass(step: number, talks: boolean): boolean {
    this.quiet = talks ? 0 : (this.quiet + step) % (QUIET + SHOWN);
    return this.quiet >= QUIET;
  }
}
