import { atEnd } from '../lifetime.ts';

/** Keeps the screen on while it is wanted; browsers give it up when the page is hidden, so it is asked for again. */
export class WakeLock {
  private wanted = false;
  private lock: WakeLockSentinel | null = null;
  private asking = false;

  constructor(signal: AbortSignal) {
    document.addEventListener('visibilitychange', () => void this.settle(), { signal });
    atEnd(signal, () => this.want(false));
  }

  want(wanted: boolean): void {
    if (wanted === this.wanted) return;
    this.wanted = wanted;
    void this.settle();
  }

  private async settle(): Promise<void> {
    if (!this.wanted) {
      void this.lock?.release();
      this.lock = null;
    } else if (document.visibilityState === 'visible' && !this.asking && (this.lock?.released ?? true)) {
      this.asking = true;
      // A battery that is low, or a browser that knows none of it: the talk goes on without.
      this.lock = (await navigator.wakeLock?.request('screen').catch(() => null)) ?? null;
      this.asking = false;
      if (!this.wanted) await this.settle();
    }
  }
}
