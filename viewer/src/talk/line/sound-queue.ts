import { MICROPHONE_RATE, type AudioMessage, type TalkMessage } from '../../protocol.ts';

const MOST_IN_FLIGHT = 0.6 * MICROPHONE_RATE; // samples: a round trip longer than that loses sound
const MOST_WAITING = 0.4 * MICROPHONE_RATE;

/** What has to arrive in the order in which it was recorded. */
export type Recorded = AudioMessage | TalkMessage;

/**
 * Microphone sound on its way to the server, and the button that belongs to it.
 *
 * A network that stalls delivers later what it was given before, and browsers do not say how much
 * that is. So sound is sent only a little ahead of what the server acknowledges; of what waits
 * the oldest is dropped. The button's messages are never dropped and keep their place.
 */
export class SoundQueue {
  private readonly send: (message: Recorded) => void;
  private readonly stalled: (stalls: boolean) => void;
  private waiting: Recorded[] = [];
  private inFlight: number[] = []; // samples of each frame that is not acknowledged
  private acknowledged = 0; // frames of this connection
  private stalls = false;

  /** @param stalled the network begins to lose sound, or carries it again */
  constructor(send: (message: Recorded) => void, stalled: (stalls: boolean) => void) {
    this.send = send;
    this.stalled = stalled;
  }

  /** A connection has opened: nothing is on its way. */
  reset(): void {
    this.waiting = [];
    this.inFlight = [];
    this.acknowledged = 0;
    this.stalls = false;
  }

  push(message: Recorded): void {
    this.waiting.push(message);
    this.flush();
    if (this.dropOldest() && !this.stalls) this.stalled((this.stalls = true));
  }

  /** @param frames how many have arrived of those sent on this connection */
  acknowledge(frames: number): void {
    this.inFlight.splice(0, frames - this.acknowledged);
    this.acknowledged = frames;
    if (this.stalls) this.stalled((this.stalls = false));
    this.flush();
  }

  private flush(): void {
    for (let next = this.waiting[0]; next && this.mayLeave(next); next = this.waiting[0]) {
      if (next.type === 'audio') this.inFlight.push(next.pcm.length);
      this.waiting.shift();
      this.send(next);
    }
  }

  private mayLeave(message: Recorded): boolean {
    if (message.type !== 'audio' || this.inFlight.length === 0) return true;
    return sum(this.inFlight) + message.pcm.length <= MOST_IN_FLIGHT;
  }

  /** Whether there was too much. */
  private dropOldest(): boolean {
    const before = this.waiting.length;
    while (sum(this.waiting.map(samples)) > MOST_WAITING) {
      this.waiting.splice(this.waiting.findIndex(({ type }) => type === 'audio'), 1);
    }
    return this.waiting.length < before;
  }
}

const samples = (message: Recorded) => (message.type === 'audio' ? message.pcm.length : 0);

const sum = (values: readonly number[]) => values.reduce((total, value) => total + value, 0);
