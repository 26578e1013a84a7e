import { PageError } from '../errors.ts';
import {
  decode,
  encode,
  VERSION,
  type ClientMessage,
  type ServerMessage,
  type WelcomeMessage,
} from '../protocol.ts';

const FIRST_RETRY = 300; // ms
const LONGEST_RETRY = 5000;

/** What a connection tells its owner. */
export interface ConnectionEvents {
  message(message: ServerMessage): void;
  /** The line is up; `resumed` tells whether the session of before goes on. */
  welcome(message: WelcomeMessage): void;
  /** The line is down; it will be tried again. */
  lost(): void;
  /** The line is down for good. */
  failed(error: PageError): void;
}

/** One WebSocket that comes back: after a drop it resumes its session where it broke off. */
export class Connection {
  private socket: WebSocket | null = null;
  private session: string | null = null;
  private lastIndex = -1;
  private wishes: Record<string, string> = {};
  private retry = FIRST_RETRY;
  private welcomed = false;
  private readonly url: string;
  private readonly events: ConnectionEvents;

  constructor(url: string, events: ConnectionEvents) {
    this.url = url;
    this.events = events;
  }

  open(): void {
    const socket = new WebSocket(this.url);
    socket.binaryType = 'arraybuffer';
    socket.onopen = () => {
      const { session, lastIndex: last_index, wishes } = this;
      socket.send(encode({ type: 'hello', version: VERSION, session, last_index, wishes }));
    };
    socket.onmessage = (event: MessageEvent<string | ArrayBuffer>) => this.receive(event.data);
    socket.onclose = () => this.closed();
    this.socket = socket;
  }

  /** Sends if the line is up; false if it is not. */
  send(message: ClientMessage): boolean {
    if (!this.welcomed) return false;
    this.socket!.send(encode(message));
    return true;
  }

  /** Leaves the session for a new one with other services, by kind. */
  restart(wishes: Record<string, string>): void {
    Object.assign(this.wishes, wishes);
    this.session = null;
    this.lastIndex = -1;
    this.socket?.close(1000); // on purpose: the server gives the place away at once
  }

  private receive(frame: string | ArrayBuffer): void {
    const message = decode(frame);
    if (message.type === 'welcome') this.welcome(message);
    else if (message.type === 'error' && message.fatal) this.fail(new PageError(message.message));
    else if (message.type !== 'speech') this.events.message(message);
    else if (message.index > this.lastIndex) {
      this.lastIndex = message.index; // a resume may repeat what is already here
      this.events.message(message);
    }
  }

  private welcome(message: WelcomeMessage): void {
    if (message.version !== VERSION) {
      this.fail(new PageError('The server speaks another version of the protocol; reload the page.'));
      return;
    }
    this.session = message.session;
    if (!message.resumed) this.lastIndex = -1;
    this.retry = FIRST_RETRY;
    this.welcomed = true;
    this.events.welcome(message);
  }

  private closed(): void {
    this.welcomed = false;
    this.events.lost();
    setTimeout(() => this.open(), this.retry);
    this.retry = Math.min(2 * this.retry, LONGEST_RETRY);
  }

  private fail(error: PageError): void {
    this.welcomed = false;
    this.socket!.onclose = null;
    this.socket!.close();
    this.events.failed(error);
  }
}

/** The server's WebSocket beside this page. */
export function socketUrl(page: Location): string {
  const url = new URL('ws', page.href);
  url.protocol = page.protocol === 'https:' ? 'wss:' : 'ws:';
  url.search = url.hash = '';
  return url.href;
}
