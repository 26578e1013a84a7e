import type { BrowserContext, Page } from 'playwright-core';

/** A chunk of the microphone as it left the page. */
export interface Heard {
  sample: number;
  at: number; // ms, when it was sent
  level: number; // root mean square, full scale = 1
  playing: number | null;
  position: number; // s
  underrun: number; // s of silence that late pieces have put into what was played
}

/** A message of the server as it reached the page. */
export interface Received {
  at: number;
  type: string;
  [field: string]: unknown;
}

/** How loud the avatar was. */
export interface Loudness {
  at: number;
  level: number;
}

/** All that a test wants to know of a conversation; times are the page's performance clock. */
export interface Record {
  microphone: Heard[];
  received: Received[];
  loudness: Loudness[];
  sockets: WebSocket[]; // only in the page
  streams: MediaStream[]; // of microphones; only in the page
}

const LISTS = ['microphone', 'received', 'loudness'] as const;

declare global {
  interface Window {
    record?: Record;
  }
}

/** Watches the wire of every page that opens from now on. */
export async function recordWire(context: BrowserContext): Promise<void> {
  await context.addInitScript(() => {
    const record: Record = { microphone: [], received: [], loudness: [], sockets: [], streams: [] };
    window.record = record;
    const header = (frame: ArrayBuffer) => {
      const length = new DataView(frame).getUint32(0, true);
      return { length, fields: JSON.parse(new TextDecoder().decode(new Uint8Array(frame, 4, length))) };
    };
    const { send } = WebSocket.prototype;
    WebSocket.prototype.send = function (data) {
      if (data instanceof ArrayBuffer) {
        const { length, fields } = header(data);
        const pcm = new Int16Array(data.slice(4 + length));
        const power = pcm.reduce((sum, value) => sum + (value / 0x8000) ** 2, 0) / pcm.length;
        const { sample, playing, position } = fields;
        const { underrun } = window.ico3d!.conversation!.player;
        record.microphone.push({ sample, at: performance.now(), level: Math.sqrt(power), playing, position, underrun });
      }
      send.call(this, data);
    };
    const ask = navigator.mediaDevices.getUserMedia.bind(navigator.mediaDevices);
    navigator.mediaDevices.getUserMedia = async (constraints) => {
      const stream = await ask(constraints);
      record.streams.push(stream);
      return stream;
    };
    window.WebSocket = class extends WebSocket {
      constructor(url: string | URL) {
        super(url);
        record.sockets.push(this);
        this.addEventListener('message', ({ data }: MessageEvent<string | ArrayBuffer>) => {
          const fields = typeof data === 'string' ? JSON.parse(data) : header(data).fields;
          record.received.push({ at: performance.now(), ...fields });
        });
      }
    };
  });
}

/** Watches how loud the avatar is, every 10 ms. */
export function recordLoudness(page: Page): Promise<void> {
  return page.evaluate(() => {
    const { context, output } = window.ico3d!.conversation!.player;
    const analyser = new AnalyserNode(context, { fftSize: 256 });
    output.connect(analyser);
    const wave = new Float32Array(256);
    setInterval(() => {
      analyser.getFloatTimeDomainData(wave);
      const power = wave.reduce((sum, value) => sum + value * value, 0) / wave.length;
      window.record!.loudness.push({ at: performance.now(), level: Math.sqrt(power) });
    }, 10);
  });
}

/** What has been read of each page's record. */
const known = new WeakMap<Page, { origin: number; record: Record }>();

/** Everything recorded so far; only what is new crosses from the page, as text, for this is asked often. */
export async function readRecord(page: Page): Promise<Record> {
  const before = known.get(page);
  const counts = { microphone: 0, received: 0, loudness: 0 };
  if (before) for (const list of LISTS) counts[list] = before.record[list].length;
  const text = await page.evaluate(
    ({ origin, counts }) => {
      const { microphone, received, loudness } = window.record!;
      const same = origin === performance.timeOrigin; // else another page was opened, with a record of its own
      const later = <T>(list: T[], count: number) => list.slice(same ? count : 0);
      return JSON.stringify({
        origin: performance.timeOrigin,
        microphone: later(microphone, counts.microphone),
        received: later(received, counts.received),
        loudness: later(loudness, counts.loudness),
      });
    },
    { origin: before?.origin, counts },
  );
  const { origin, ...news } = JSON.parse(text) as { origin: number } & Pick<Record, (typeof LISTS)[number]>;
  const old = before?.origin === origin ? before.record : { microphone: [], received: [], loudness: [] };
  const record: Record = {
    microphone: [...old.microphone, ...news.microphone],
    received: [...old.received, ...news.received],
    loudness: [...old.loudness, ...news.loudness],
    sockets: [],
    streams: [],
  };
  known.set(page, { origin, record });
  return record;
}

/** The state of each microphone that the browser gave: it shows that it records while one is `live`. */
export function microphones(page: Page): Promise<string[]> {
  return page.evaluate(() => window.record!.streams.flatMap((stream) => stream.getTracks().map(({ readyState }) => readyState)));
}
