import { BEAT_SECONDS, VERSION } from '../../src/protocol.ts';

/** A message that the page sent; of `audio` only what is not sound. */
export type Sent = { type: string; at: number } & Record<string, unknown>;

/** The browser's WebSocket, on whose other end the test is the server. */
export class ScriptedSocket {
  static all: ScriptedSocket[] = [];
  binaryType = '';
  onopen: (() => void) | null = null;
  onmessage: ((event: { data: string }) => void) | null = null;
  onclose: ((event: { code: number }) => void) | null = null;
  readonly sent: Sent[] = [];
  readonly url: string;
  closed = false;
  beats = true; // as a server does, once it has welcomed

  constructor(url: string) {
    this.url = url;
    ScriptedSocket.all.push(this);
  }

  static get last(): ScriptedSocket {
    return ScriptedSocket.all.at(-1)!;
  }

  send(frame: string | ArrayBuffer): void {
    if (this.closed) throw new DOMException('closed', 'InvalidStateError');
    this.sent.push({ ...fields(frame), at: performance.now() });
  }

  close(): void {
    this.closed = true;
  }

  says(message: { type: string } & Record<string, unknown>): void {
    this.onmessage!({ data: JSON.stringify(message) });
  }

  /** Opens, if it has not, and gets a place in the queue. */
  queue(position: number, seconds: number | null): void {
    if (this.of('hello').length === 0) this.onopen!();
    this.says({ type: 'place', session: 'place', position, seconds });
  }

  /** Opens and is welcomed. */
  welcome(more: Record<string, unknown> = {}): void {
    if (this.of('hello').length === 0) this.onopen!();
    const name = { name: 'scripted', stand_in: false };
    const services = { recognition: name, language: name, voice: name };
    const welcome = { type: 'welcome', version: VERSION, session: 'first', resumed: false, services, notices: [], dictation: null, offers: [], remembers: false };
    this.says({ ...welcome, ...more });
    this.beat();
  }

  private beat(): void {
    if (this.closed) return;
    if (this.beats) this.onmessage?.({ data: JSON.stringify({ type: 'beat' }) });
    setTimeout(() => this.beat(), 1000 * BEAT_SECONDS);
  }

  /** Says why and hangs up. */
  hangUp(message: string, code: number, again: boolean): void {
    this.onopen?.();
    this.says({ type: 'error', message, fatal: true, again, code: '', values: {} });
    this.drop(code);
  }

  drop(code = 1006): void {
    this.closed = true;
    this.onclose?.({ code });
  }

  /** What the page sent of a kind. */
  of(type: string): Sent[] {
    return this.sent.filter((message) => message.type === type);
  }
}

function fields(frame: string | ArrayBuffer): { type: string } & Record<string, unknown> {
  if (typeof frame === 'string') return JSON.parse(frame);
  const length = new DataView(frame).getUint32(0, true);
  return JSON.parse(new TextDecoder().decode(new Uint8Array(frame, 4, length)));
}
