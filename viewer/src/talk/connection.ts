import {
  RESUME_SECONDS,
  VERSION,
  type AckMessage,
  type BeatMessage,
  type ClientMessage,
  type PlaceMessage,
  type ServerMessage,
  type SpeechMessage,
  type WelcomeMessage,
} from '../protocol.ts';
import { say, type Sentence } from '../words/text.ts';
import { Allowance } from './line/allowance.ts';
import { Silence } from './line/silence.ts';
import { SoundQueue } from './line/sound-queue.ts';
import { told } from './told.ts';
import { decode, encode } from './wire.ts';

const FIRST_RETRY = 300; // ms; the next waits are twice as long each
const LONGEST_RETRY = 5000; // while the session may still be resumed
const FIRST_VISIT = 5000; // ms until a server whose queue is full is asked again
const LONGEST_VISIT = 60_000;
const FULL = 1013; // close code: the queue is full, too
const SILENT = 4000; // close code: another line speaks
/** Bytes of text, and of sound with its faces, that a server may send at once, and for long per second: an answer has 15 MB. */
const TEXT = [1 << 20, 1 << 15] as const;
const SOUND = [1 << 25, 1 << 18] as const;
/** Frames likewise, each of which costs the page time, whatever it holds: a server speaks two seconds ahead, in ten pieces each. */
const FRAMES = [1024, 128] as const;
const LONGEST_HANDSHAKE = 8000; // ms, of a line that is to go on with a session

/** The session is over. */
export interface Ending {
  sentence: Sentence;
  /** Whether a new session may succeed; else only loading the page anew helps. */
  again: boolean;
  /** When a new one is tried without being asked for, ms from now; null for never. */
  wait: number | null;
}

/** What the server says once the line is up: all but what keeps the line itself. */
export type SessionMessage = Exclude<ServerMessage, WelcomeMessage | PlaceMessage | AckMessage | BeatMessage>;

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
  /** The line is down, or silent; the session is resumed as soon as there is one again. */
  lost(): void;
  /** The line that was silent speaks again: nothing is lost. */
  regained(): void;
  /** All places are taken; the server keeps one in a queue, and the line stays up for it. */
  queued(place: PlaceMessage): void;
  /** The line loses sound, or carries it again. */
  stalled(stalls: boolean): void;
  ended(ending: Ending): void;
}

/** One WebSocket that comes back: after a drop it resumes its session where it broke off. */
export class Connection {
  private socket: WebSocket | null = null; // that carries the session, or is to
  private trial: WebSocket | null = null; // beside one that is silent
  private silentSince: number | null = null; // ms on the performance clock
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
  private readonly text = new Allowance(...TEXT);
  private readonly bytes = new Allowance(...SOUND);
  private readonly frames = new Allowance(...FRAMES);
  private readonly silence = new Silence(() => this.fellSilent());
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
    if (this.trial || (this.socket && this.silentSince === null)) return;
    this.lastUp ??= performance.now();
    const socket = new WebSocket(this.url());
    const hangs = this.session ? setTimeout(() => this.abandon(socket), LONGEST_HANDSHAKE) : undefined;
    socket.binaryType = 'arraybuffer';
    socket.onopen = () => {
      clearTimeout(hangs);
      this.opened(socket);
    };
    socket.onmessage = (event: MessageEvent<string | ArrayBuffer>) => this.receive(event.data);
    socket.onclose = ({ code }) => {
      clearTimeout(hangs);
      this.closed(socket, code);
    };
    if (this.socket) this.trial = socket;
    else this.socket = socket;
  }

  /** Sends if the line is up; false if it is not. What only holds now is given to a silent one, too. */
  send(message: ClientMessage): boolean {
    const asks = message.type === 'text' || message.type === 'say';
    if (!this.welcomed || (asks && this.silentSince !== null)) return false;
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

  /** The visitor ends the session; another one may begin. */
  hangUp(): void {
    this.close();
    this.end({ sentence: say('ended'), again: true }, false);
  }

  /** Leaves for good. */
  close(): void {
    clearTimeout(this.retry);
    this.welcomed = false;
    this.leave(this.trial, 1000);
    this.leave(this.socket, 1000);
    this.socket = this.trial = null;
    this.speaks();
    this.silence.end();
  }

  private opened(socket: WebSocket): void {
    if (socket === this.trial) this.change(socket);
    const { lastIndex: last_index, wishes } = this;
    const session = this.place ?? this.session;
    socket.send(encode({ type: 'hello', version: VERSION, session, last_index, wishes }));
  }

  /** Another line, or none, takes the place of one that is silent. */
  private change(socket: WebSocket | null): void {
    this.leave(this.socket, SILENT);
    this.socket = socket;
    this.trial = null;
    this.lastUp = performance.now();
    this.welcomed = false;
    this.speaks();
    this.silence.end();
  }

  /** Hears nothing more of a line, and closes it. */
  private leave(socket: WebSocket | null, code: number): void {
    if (!socket) return;
    socket.onopen = socket.onmessage = socket.onclose = null;
    socket.close(code);
  }

  /** Whatever it was, no line is silent now; returns whether one was. */
  private speaks(): boolean {
    const was = this.silentSince !== null;
    this.silentSince = null;
    return was;
  }

  private fellSilent(): void {
    this.silentSince = performance.now();
    this.events.lost();
    this.wait = 0;
    this.open();
  }

  /** A handshake that takes too long: the network may be another one now. */
  private abandon(socket: WebSocket): void {
    if (socket !== this.socket && socket !== this.trial) return; // it was left already
    this.leave(socket, SILENT);
    this.closed(socket, 1006);
  }

  private receive(frame: string | ArrayBuffer): void {
    if (this.welcomed) this.silence.heard();
    if (this.speaks()) this.goOn();
    // What is beyond is not heard: it may be packed a thousandfold, and is kept until it is spoken.
    if (!this.frames.take(1) || !(typeof frame === 'string' ? this.text.take(frame.length) : this.bytes.take(frame.byteLength))) return;
    const message = decode(frame);
    if (message.type === 'welcome') this.welcome(message);
    else if (message.type === 'place') this.queue(message);
    else if (message.type === 'ack') this.sound.acknowledge(message.frames);
    else if (message.type === 'error' && message.fatal) this.dismissed(told(message), message.again);
    else if (message.type === 'speech') this.speech(message);
    else if (message.type !== 'beat') this.events.message(message);
  }

  /** The line was silent and is not any more: no other one is needed. */
  private goOn(): void {
    clearTimeout(this.retry);
    this.leave(this.trial, SILENT);
    this.trial = null;
    this.wait = 0;
    this.events.regained();
  }

  private speech(message: SpeechMessage): void {
    if (message.index <= this.lastIndex) return; // a resume may repeat what is already here
    this.lastIndex = message.index;
    this.events.message(message);
  }

  private welcome(message: WelcomeMessage): void {
    if (message.version !== VERSION) {
      return this.dismissed(say('version'), false);
    }
    const replaced = this.session !== null && this.session !== message.session;
    this.session = message.session;
    this.place = null;
    if (!message.resumed) this.lastIndex = -1;
    this.wait = 0;
    this.over = false;
    this.sound.reset();
    this.welcomed = true;
    this.silence.heard();
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
  private dismissed(sentence: Sentence, again: boolean): void {
    this.fatal = { sentence, again };
    this.welcomed = false;
    this.socket!.close();
  }

  private closed(socket: WebSocket, code: number): void {
    if (socket === this.trial) return this.tried();
    const now = performance.now();
    if (this.welcomed || (this.place !== null && this.wait === 0)) this.lastUp = now;
    this.welcomed = false;
    this.silence.end();
    this.speaks();
    this.socket = this.trial;
    this.trial = null;
    if (this.socket) return; // it is being tried already
    if (this.fatal) this.end(this.fatal, code === FULL);
    else if (this.over || now - this.lastUp! > 1000 * RESUME_SECONDS) {
      this.end({ sentence: say('unreachable'), again: true }, true);
    } else {
      this.events.lost();
      this.openLater(FIRST_RETRY, LONGEST_RETRY);
    }
  }

  /** No other line took the place of the silent one, which is not waited for for ever. */
  private tried(): void {
    this.trial = null;
    if (performance.now() - this.silentSince! > 1000 * RESUME_SECONDS) this.change(null);
    this.openLater(FIRST_RETRY, LONGEST_RETRY);
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
    clearTimeout(this.retry);
    this.wait = Math.min(Math.max(first, 2 * this.wait), longest);
    this.retry = setTimeout(() => this.open(), this.wait);
  }
}
