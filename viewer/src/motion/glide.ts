const ACCELERATION = 4; // body seconds per second, per second: from captured speed to rest in 1/4 s
const CLOSE = 1e-3; // s, of the body: as good as there

/** A body time that goes after another one, never faster than it may, and with eased turns. */
export class Glide {
  time: number; // s
  velocity = 0; // body seconds per second
  private there = false; // exactly at its target

  constructor(time: number) {
    this.time = time;
  }

  /**
   * Goes on by `step` seconds after a target; once there, it stays with it exactly as long as the
   * target keeps the limit.
   *
   * @param target where it is wanted after the step
   * @param pace the target's own velocity
   * @param limit of speed
   * @returns whether it is there
   */
  follow(target: number, pace: number, limit: number, step: number): boolean {
    if (step <= 0) return this.there;
    const whole = target - this.time;
    const gap = whole - pace * step; // before the step
    const wanted = pace + Math.sign(gap) * approach(Math.abs(gap), step);
    const change = clamp(clamp(wanted, -limit, limit) - this.velocity, -ACCELERATION * step, ACCELERATION * step);
    const velocity = clamp(this.velocity + change, -limit, limit);
    const reaches = Math.sign(gap) * (velocity * step - whole) >= -CLOSE;
    const keeps = Math.abs(whole) <= limit * step;
    this.there = keeps && (this.there || reaches);
    this.velocity = this.there ? whole / step : velocity;
    this.time = this.there ? target : this.time + velocity * step;
    return this.there;
  }

  /** Makes it go after something else: it is no longer there. */
  leave(): void {
    this.there = false;
  }

  /** Stands still where it is. */
  stand(): void {
    this.velocity = 0;
    this.leave();
  }
}

/** The speed from which, after another step, there is just room to brake. */
function approach(gap: number, step: number): number {
  return ACCELERATION * (Math.sqrt(step * step + (2 * gap) / ACCELERATION) - step);
}

/** The nearest value within bounds. */
export function clamp(value: number, low: number, high: number): number {
  return Math.min(Math.max(value, low), high);
}
