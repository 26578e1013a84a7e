import { atEnd } from '../lifetime.ts';

const PATIENCE = 700; // ms in which sound may go on without being told of

/**
 * Lets sound go on that the system has stopped: for a telephone call, another program, a headset that was unplugged.
 *
 * It goes on by itself where browsers allow that, else with the visitor's next tap or key.
 */
export class SoundGuard {
  private readonly context: AudioContext;
  private readonly tell: (stopped: boolean) => void;
  private ran = false; // before, browsers wait for a click anyway
  private told = false;
  private waiting: ReturnType<typeof setTimeout> | undefined;

  /** @param tell takes whether sound has stopped and needs the visitor */
  constructor(context: AudioContext, tell: (stopped: boolean) => void, signal: AbortSignal) {
    this.context = context;
    this.tell = tell;
    this.ran = context.state === 'running';
    context.onstatechange = () => this.changed();
    const again = () => this.resume();
    for (const event of ['pointerup', 'keydown', 'visibilitychange']) {
      document.addEventListener(event, again, { signal, capture: true });
    }
    atEnd(signal, () => {
      clearTimeout(this.waiting);
      context.onstatechange = null;
    });
  }

  private changed(): void {
    if (this.context.state === 'running') {
      this.ran = true;
      clearTimeout(this.waiting);
      this.waiting = undefined;
      if (this.told) this.tell((this.told = false));
    } else if (this.ran && this.context.state !== 'closed') {
      this.resume();
      this.waiting ??= setTimeout(() => this.tell((this.told = true)), PATIENCE);
    }
  }

  private resume(): void {
    const { state } = this.context;
    if (this.ran && state !== 'running' && state !== 'closed') void this.context.resume().catch(() => {});
  }
}
