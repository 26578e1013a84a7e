import { PageError } from '../errors.ts';
import { Recording, type OnChunk } from './recording.ts';

/**
 * The visitor's microphone as PCM16 at 16 kHz in chunks.
 *
 * It is open exactly while sound comes from it: opening ends with the first sound, and whatever
 * ends the sound closes it and is told.
 */
export class Microphone {
  private recording: Recording | null = null; // open
  private starting: Promise<boolean> | null = null;
  private stopping = new AbortController(); // of the latest start
  private readonly onChunk: OnChunk;
  private readonly onLost: (error: PageError) => void;

  /** @param onLost an open microphone has closed by itself */
  constructor(onChunk: OnChunk, onLost: (error: PageError) => void) {
    this.onChunk = onChunk;
    this.onLost = onLost;
  }

  get open(): boolean {
    return this.recording !== null;
  }

  /** The sound of the device; null while the microphone is closed. */
  get track(): MediaStreamTrack | null {
    return this.recording?.track ?? null;
  }

  /**
   * Asks for the microphone and opens it; calls that come while it opens wait for the same opening.
   *
   * @returns whether it is open: false if `stop` was called while it opened
   * @throws PageError saying what the visitor can do about it
   */
  start(): Promise<boolean> {
    if (this.recording) return Promise.resolve(true);
    if (!this.starting) {
      this.stopping = new AbortController();
      this.starting = this.begin(this.stopping.signal);
    }
    return this.starting;
  }

  stop(): void {
    this.stopping.abort();
    this.starting = null;
    this.recording = null;
  }

  private async begin(stopped: AbortSignal): Promise<boolean> {
    const cancelled = new Promise<never>((_, reject) => {
      stopped.addEventListener('abort', () => reject(stopped.reason)); // a browser that asks may wait for ever
    });
    try {
      const opened = Recording.open(this.onChunk, (error) => this.lose(error), stopped);
      const recording = await Promise.race([opened, cancelled]);
      if (!stopped.aborted) this.recording = recording;
    } catch (error) {
      if (!stopped.aborted) throw error;
    } finally {
      if (!stopped.aborted) this.starting = null;
    }
    return !stopped.aborted;
  }

  private lose(error: PageError): void {
    this.stop();
    this.onLost(error);
  }
}
