import { Refusal, type Recordings, type Status } from '../recordings.ts';

const AGAIN = 1000; // ms after which an unanswered request is made once more
const SLICE = 4 << 20; // bytes of a video that are sent at once
const HEAD = 16; // bytes by which the server knows a video: browsers begin some with a piece of a single byte

/** Sends a part to the server piece by piece, in order; what is not taken stays here until it is. */
export class Sending {
  private readonly recordings: Recordings;
  private readonly name: string;
  private readonly part: string;
  private readonly take = crypto.randomUUID().replaceAll('-', '');
  private readonly onLost: (lost: boolean) => void;
  private queue: Promise<void> = Promise.resolve();
  private sent = 0;
  private held = new Blob(); // the beginning, as long as it is too short to be known

  /** @param onLost the server does not answer, or does again */
  constructor(recordings: Recordings, name: string, part: string, onLost: (lost: boolean) => void) {
    this.recordings = recordings;
    this.name = name;
    this.part = part;
    this.onLost = onLost;
  }

  /** Sends a piece behind those before; rejects if the server refuses it. */
  add(piece: Blob): Promise<void> {
    this.queue = this.queue.then(() => this.send(piece));
    this.queue.catch(() => {}); // heard of where it is waited for
    return this.queue;
  }

  /** Sends a video, slice by slice. */
  async addVideo(video: Blob, tell: (percent: number) => void): Promise<void> {
    for (let at = 0; at < video.size; at += SLICE) {
      tell(Math.floor((100 * at) / video.size));
      await this.add(video.slice(at, at + SLICE));
    }
  }

  /** Waits until everything has arrived, and lets it be the part. */
  async keep(): Promise<Status> {
    await this.queue;
    await this.deliver(this.held);
    return this.untilAnswered(() => this.recordings.keep(this.name, this.part, this.take));
  }

  private async send(piece: Blob): Promise<void> {
    this.held = new Blob([this.held, piece]);
    if (this.sent > 0 || this.held.size >= HEAD) await this.deliver(this.held);
  }

  private async deliver(piece: Blob): Promise<void> {
    this.held = new Blob();
    if (piece.size === 0) return;
    await this.untilAnswered(() => this.recordings.append(this.name, this.part, this.take, this.sent, piece));
    this.sent += piece.size;
  }

  private async untilAnswered<Answer>(ask: () => Promise<Answer>): Promise<Answer> {
    for (let lost = false; ; lost = true) {
      try {
        const answer = await ask();
        if (lost) this.onLost(false);
        return answer;
      } catch (error) {
        if (!(error instanceof Refusal) || error.status !== 0) throw error;
        if (!lost) this.onLost(true);
        await new Promise((resolve) => setTimeout(resolve, AGAIN));
      }
    }
  }
}
