/**
 * Asks for a picture with each refresh of the screen, or as soon as the one before is done: a picture
 * that takes a little longer than a refresh would else cost two.
 */
export class Pulse {
  private readonly isBusy: () => boolean;
  private request = 0; // of an animation frame
  private frame: ((now: number) => void) | null = null;
  private missed = false; // a refresh, because a picture was not done

  /** @param isBusy whether a picture is being drawn */
  constructor(isBusy: () => boolean) {
    this.isBusy = isBusy;
  }

  /** Asks from now on, with a time in ms of the performance clock; nobody any more for null. */
  run(frame: ((now: number) => void) | null): void {
    cancelAnimationFrame(this.request);
    this.frame = frame;
    this.missed = false;
    if (frame) this.request = requestAnimationFrame(this.next);
  }

  /** A picture is done. */
  done(): void {
    if (!this.missed) return;
    this.missed = false;
    this.frame?.(performance.now());
  }

  private readonly next = (now: number) => {
    this.request = requestAnimationFrame(this.next);
    if (this.isBusy()) this.missed = true;
    else this.frame!(now);
  };
}
