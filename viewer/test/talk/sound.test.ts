import { afterEach, beforeEach, expect, test, vi } from 'vitest';
import { MICROPHONE_CHUNK, MICROPHONE_RATE } from '../../src/protocol.ts';
import { Connection } from '../../src/talk/connection.ts';
import { ScriptedSocket } from '../../support/doubles/scripted-socket.ts';

const CHUNK = (1000 * MICROPHONE_CHUNK) / MICROPHONE_RATE; // ms

beforeEach(() => {
  vi.useFakeTimers({ now: 0, toFake: ['setTimeout', 'clearTimeout', 'performance'] });
  vi.stubGlobal('WebSocket', ScriptedSocket);
  ScriptedSocket.all = [];
});
afterEach(() => {
  vi.useRealTimers();
  vi.unstubAllGlobals();
});

/** A page that talks without pause, and a network that brings acknowledgements after a while. */
class Talk {
  readonly stalls: [at: number, stalls: boolean][] = [];
  readonly connection: Connection;
  roundTrip = 100; // ms
  private sample = 0;
  private frames = 0;
  private acknowledged = 0;
  private stalledAt = Infinity;

  constructor() {
    const nothing = () => {};
    this.connection = new Connection(() => 'ws://server/ws', {
      message: nothing,
      welcome: nothing,
      lost: nothing,
      regained: nothing,
      ended: nothing,
      queued: () => {}, stalled: (stalls) => this.stalls.push([performance.now(), stalls]),
    });
    this.connection.open();
    ScriptedSocket.last.welcome();
  }

  /** Records for a while: chunk by chunk, what is recorded is sent. */
  record(chunks: number): void {
    for (let i = 0; i < chunks; i++) {
      this.settle();
      vi.advanceTimersByTime(CHUNK);
      this.settle();
      this.push();
    }
  }

  /** From now on nothing comes, no beat either. */
  stall(): void {
    this.socket.beats = false;
    this.stalledAt = performance.now();
  }

  flow(): void {
    this.socket.beats = true;
    this.stalledAt = Infinity;
    this.settle();
  }

  /** The latest that said hello: beside one that stalls, others are tried. */
  get socket(): ScriptedSocket {
    return ScriptedSocket.all.findLast((socket) => socket.of('hello').length > 0)!;
  }

  get sound() {
    return this.socket.of('audio') as unknown as { at: number; sample: number }[];
  }

  private push(): void {
    this.connection.send({ type: 'audio', sample: this.sample, pcm: new Int16Array(MICROPHONE_CHUNK), playing: null, position: 0 });
    this.sample += MICROPHONE_CHUNK;
  }

  /** Brings the acknowledgements that are due. */
  private settle(): void {
    const now = Math.min(performance.now(), this.stalledAt);
    this.frames = this.sound.filter(({ at }) => at + this.roundTrip <= now).length;
    if (this.frames === this.acknowledged) return;
    this.acknowledged = this.frames;
    this.socket.says({ type: 'ack', frames: this.frames });
  }
}

const samples = (chunks: { sample: number }[]) => chunks.map(({ sample }) => sample / MICROPHONE_CHUNK);
const range = (from: number, to: number) => Array.from({ length: to - from }, (_, i) => from + i);

test('after a stall of 20 s a second of old sound arrives, and the conversation goes on', () => {
  const talk = new Talk();
  talk.record(62);
  expect(samples(talk.sound)).toEqual(range(0, 62));
  expect(talk.stalls).toEqual([]);

  talk.stall(); // with what was recorded in the last 100 ms on its way
  talk.record(625);
  const during = talk.sound.slice(62);
  expect(samples(during)).toEqual(range(62, 76)); // with the last four before it 18 in flight: 0.576 s
  expect(talk.stalls).toEqual([[CHUNK * (62 + 14 + 12 + 1), true]]);

  talk.flow(); // brings what was in flight, and then what was recorded last
  expect(samples(talk.sound.slice(76))).toEqual(range(62 + 625 - 12, 62 + 625));
  const old = (18 + 12) * CHUNK;
  expect(old).toBeLessThan(1000);
  expect(talk.stalls.at(-1)).toEqual([performance.now(), false]);

  talk.record(31); // gaps stay gaps: no sample gets another one's number
  expect(samples(talk.sound.slice(88))).toEqual(range(687, 718));
  for (const { at, sample } of talk.sound.slice(88)) expect(at).toBe(((sample / MICROPHONE_CHUNK) + 1) * CHUNK);
});

test('a stall of less than a second loses nothing', () => {
  const talk = new Talk();
  talk.record(31);
  talk.stall();
  talk.record(26);
  talk.flow();
  talk.record(31);
  expect(samples(talk.sound)).toEqual(range(0, 88));
  expect(talk.stalls).toEqual([]);
});

test('a round trip of half a second loses nothing', () => {
  const talk = new Talk();
  talk.roundTrip = 500;
  talk.record(312);
  expect(samples(talk.sound)).toEqual(range(0, 312));
  expect(talk.stalls).toEqual([]);
});

test('in a stall control messages are sent at once, and none is dropped', () => {
  const talk = new Talk();
  talk.stall();
  for (let i = 0; i < 300; i++) {
    talk.record(2);
    expect(talk.connection.send({ type: 'clock', utterance: 0, position: i, body_time: 0 })).toBe(true);
    expect(talk.socket.sent.at(-1)).toMatchObject({ type: 'clock', position: i, at: performance.now() });
  }
  expect(talk.connection.send({ type: 'text', text: 'Are you there?' })).toBe(false); // it stays in the text box
  expect(talk.socket.of('clock')).toHaveLength(300);
  expect(talk.socket.of('text')).toHaveLength(0);
});

test('the button to talk keeps its place among the sound, and is not dropped with it', () => {
  const talk = new Talk();
  const button = (pressed: boolean) => talk.connection.send({ type: 'talk', pressed });
  const order = () => talk.socket.sent.slice(1).map(({ type, sample, pressed }) => (type === 'talk' ? pressed : (sample as number) / MICROPHONE_CHUNK));
  button(true);
  talk.record(2);
  expect(order()).toEqual([true, 0, 1]);
  talk.stall();
  talk.record(20); // 18 of 22 in flight
  button(false);
  talk.record(100);
  button(true);
  talk.record(5);
  expect(order()).toEqual([true, ...range(0, 18), false]); // nothing is left of what came before it
  talk.flow();
  expect(order()).toEqual([true, ...range(0, 18), false, ...range(115, 122), true, ...range(122, 127)]);
});

test('a new connection begins with nothing on its way', () => {
  const talk = new Talk();
  talk.stall();
  talk.record(100);
  ScriptedSocket.last.drop();
  vi.advanceTimersByTime(300);
  ScriptedSocket.last.welcome({ resumed: true });
  talk.record(18);
  expect(samples(talk.sound)).toEqual(range(100, 118));
  ScriptedSocket.last.says({ type: 'ack', frames: 18 });
  talk.record(18);
  expect(samples(talk.sound)).toEqual(range(100, 136));
});
