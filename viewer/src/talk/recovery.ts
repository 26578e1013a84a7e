import { atEnd } from '../lifetime.ts';

const FIRST = 1000; // ms until a microphone that was lost is opened again
const REMEMBERED = 300_000; // ms for which one that does not open is waited for; later nobody expects it

/** What opens a microphone. */
export interface Reopening {
  /** Whether it is open by the visitor's wish. */
  isOpen(): boolean;
  /** Opens it, anew if it is open; returns whether that succeeded. */
  reopen(): Promise<boolean>;
}

/**
 * Opens a microphone again that a telephone call, another program or an unplugged headset has closed.
 *
 * It is tried at once, and then when devices change or the page is looked at again. An open microphone follows the
 * system when that chooses another one, as when a headset is connected.
 */
export class Recovery {
  private readonly microphone: Reopening;
  private lostAt: number | null = null; // of a microphone that is to open again, ms on the performance clock
  private trying = false;
  private first: ReturnType<typeof setTimeout> | undefined;
  private group: string | null = null; // of the default input

  constructor(microphone: Reopening, signal: AbortSignal) {
    this.microphone = microphone;
    navigator.mediaDevices?.addEventListener('devicechange', () => void this.devicesChanged(), { signal });
    document.addEventListener('visibilitychange', () => document.visibilityState === 'visible' && void this.attempt(), { signal });
    atEnd(signal, () => this.cancel());
  }

  /** The microphone has opened. */
  async opened(): Promise<void> {
    this.group = await defaultGroup();
  }

  /** The microphone has closed by itself. */
  lost(): void {
    this.lostAt = performance.now();
    clearTimeout(this.first);
    this.first = setTimeout(() => void this.attempt(), FIRST);
  }

  /** The visitor decides, or there is nobody to listen any more. */
  cancel(): void {
    this.lostAt = null;
    clearTimeout(this.first);
  }

  private async devicesChanged(): Promise<void> {
    if (this.lostAt !== null) return this.attempt();
    if (!this.microphone.isOpen()) return;
    const group = await defaultGroup();
    if (group === this.group || !this.microphone.isOpen()) return;
    this.group = group;
    if (!(await this.microphone.reopen())) this.lost();
  }

  private async attempt(): Promise<void> {
    if (this.lostAt === null || this.trying) return;
    if (performance.now() - this.lostAt > REMEMBERED) return this.cancel();
    this.trying = true;
    const since = this.lostAt;
    if ((await this.microphone.reopen()) && this.lostAt === since) this.cancel();
    this.trying = false;
  }
}

/** Which device the system's default input belongs to; null where browsers do not tell. */
async function defaultGroup(): Promise<string | null> {
  const devices = await navigator.mediaDevices.enumerateDevices().catch(() => []);
  const inputs = devices.filter(({ kind }) => kind === 'audioinput');
  return (inputs.find(({ deviceId }) => deviceId === 'default') ?? inputs[0])?.groupId || null;
}
