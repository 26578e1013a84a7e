import {
  RESUME_SECONDS,
  VERSION,
  type AckMessage,
  type ClientMessage,
  type PlaceMessage,
  type ServerMessage,
  type WelcomeMessage,
} from '../protocol.ts';
import { say, type Sentence } from '../words/text.ts';
import { SoundQueue } from './sound-queue.ts';
import { told } from './told.ts';
import { decode, encode } from './wire.ts';

const FIRST_RETRY = 300; // ms; the next waits are twice as long each
const LONGEST_RETRY = 5000; // while the session may still be resumed
const FIRST_VISIT = 5000; // ms until a server whose queue is full is asked again
const LONGEST_VISIT = 60_000;
const FULL = 1013; // close code: the queue is full, too

/** The session is over. */
export interface Ending {
  sentence: Sentence;
  /** Whether a new session may succeed; else only loading the page anew helps. */
  again: boolean;
  /** When a new one is tried without being asked for, ms from now; null for never. */
  wait: number | null;
}

/** What the server says once the line is up: all but what keeps the line itself. */
export type SessionMessage = Exclude<ServerMessage, WelcomeMessage | PlaceMessage | AckMessage>;

/** What a connection tells its owner. */
export interface ConnectionEvents {
  message(message: SessionMessage): void;
  /**
   * The line is up.
   *
   * @param message `resumed` tells whether the session of before goes on
   * @param replaced there was one, which the server no longer has
   */
  welcome(message: WelcomeMessage, replaced: boolean): void;
  /** The line is down; the session is resumed as soon as it is up again. */
  lost(): void;
  /** All places are taken; the server keeps one in a queue, and the line stays up for it. */
  queued(place: PlaceMessage): void;
  /** The line loses sound, or carries it again. */
  stalled(stalls: boolean): void;
  ended(ending: Ending): void;
}

/** One WebSocket that comes back: after a drop it resumes its session where it broke off. */
export class Connection {
  private socket: WebSocket | null = null;
  private session: string | null = null;
  private place: string | null = null; // in the queue, until the session begins
  private lastIndex = -1;
  private wishes: Record<string, string> = {};
  private wait = 0; // before the latest retry, ms
  private retry: ReturnType<typeof setTimeout> | undefined;
  private welcomed = false;
  private lastUp: number | null = null; // or the first try; ms on the performance clock
  private fatal: Pick<Ending, 'sentence' | 'again'> | null = null; // the server's last word
  private over = false; // the session is, and no other one has begun
  private readonly sound: SoundQueue;
  private readonly url: () => string;
  private readonly events: ConnectionEvents;

  /** @param url gives the address anew for each try: what admits to it may expire */
  constructor(url: () => string, events: ConnectionEvents) {
    this.url = url;
    this.events = events;
    this.sound = new SoundQueue((message) => this.socket!.send(encode(message)), events.stalled);
  }

  /** Connects, unless it is trying to already. */
  open(): void {
    clearTimeout(this.retry);
    if (this.socket) return;
    this.lastUp ??= performance.now();
    const socket = new WebSocket(this.url());
    socket.binaryType = 'arraybuffer';
    socket.onopen = () => {
      const { lastIndex: last_index, wishes } = this;
      const session = this.place ?? this.session;
      socket.send(encode({ type: 'hello', version: VERSION, session, last_index, wishes }));
    };
    socket.onmessage = (event: MessageEvent<string | ArrayBuffer>) => this.receive(event.data);
    socket.onclose = ({ code }) => this.closed(code);
    this.socket = socket;
  }

  /** Sends if the line is up; false if it is not. */
  send(message: ClientMessage): boolean {
    if (!this.welcomed) return false;
    if (message.type === 'audio' || message.type === 'talk') this.sound.push(message);
    else this.socket!.send(encode(message));
    return true;
  }

  /** Leaves the session for a new one with other services, by kind. */
  restart(wishes: Record<string, string>): void {
    Object.assign(this.wishes, wishes);
    this.forget();
    this.socket?.close(1000); // on purpose: the server gives the place away at once
  }

  /** Leaves for good. */
  close(): void {
    clearTimeout(this.retry);
    this.welcomed = false;
    if (!this.socket) return;
    this.socket.onopen = this.socket.onmessage = this.socket.onclose = null;
    this.socket.close(1000);
    this.socket = null;
  }

  private receive(frame: string | ArrayBuffer): void {
    const message = decode(frame);
    if (message.type === 'welcome') this.welcome(message);
    else if (message.type === 'place') this.queue(message);
    else if (message.type === 'ack') this.sound.acknowledge(message.frames);
    else if (message.type === 'error' && message.fatal) this.hangUp(told(message), message.again);
    else if (message.type !== 'speech') this.events.message(message);
    else if (message.index > this.lastIndex) {
      this.lastIndex = message.index; // a resume may repeat what is already here
      this.events.message(message);
    }
  }

  private welcome(message: WelcomeMessage): void {
    if (message.version !== VERSION) {
      return this.hangUp(say('version'), false);
    }
    const replaced = this.session !== null && this.session !== message.session;
    this.session = message.session;
    this.place = null;
    if (!message.resumed) this.lastIndex = -1;
    this.wait = 0;
    this.over = false;
    this.sound.reset();
    this.welcomed = true;
    this.events.welcome(message, replaced);
  }

  private queue(place: PlaceMessage): void {
    this.place = place.session;
    this.lastIndex = -1;
    this.wait = 0;
    this.over = false;
    this.events.queued(place);
  }

  /** The session ends when the socket has closed: its code tells more. */
  private hangUp(sentence: Sentence, again: boolean): void {
    this.fatal = { sentence, again };
    this.welcomed = false;
    this.socket!.close();
  }

  private closed(code: number): void {
    const now = performance.now();
    if (this.welcomed || (this.place !== null && this.wait === 0)) this.lastUp = now;
    this.welcomed = false;
    this.socket = null;
    if (this.fatal) this.end(this.fatal, code === FULL);
    else if (this.over || now - this.lastUp! > 1000 * RESUME_SECONDS) {
      this.end({ sentence: say('unreachable'), again: true }, true);
    } else {
      this.events.lost();
      this.openLater(FIRST_RETRY, LONGEST_RETRY);
    }
  }

  /** @param bySelf whether a new session is tried without being asked for */
  private end({ sentence, again }: Pick<Ending, 'sentence' | 'again'>, bySelf: boolean): void {
    this.fatal = null;
    this.over = true;
    this.forget();
    if (bySelf) this.openLater(FIRST_VISIT, LONGEST_VISIT);
    this.events.ended({ sentence, again, wait: bySelf ? this.wait : null });
  }

  private forget(): void {
    this.session = this.place = null;
    this.lastIndex = -1;
  }

  private openLater(first: number, longest: number): void {
    this.wait = Math.min(Math.max(first, 2 * this.wait), longest);
    this.retry = setTimeout(() => this.open(), this.wait);
  }
}
