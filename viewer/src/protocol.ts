// Written by `python -m ico3d.chat.generating`. Edit src/ico3d/chat/wire/protocol.py instead.
import { floatFromHalf } from "./half.ts";

export const VERSION = 5;
export const MICROPHONE_RATE = 16000; // Hz
export const MICROPHONE_CHUNK = 512; // samples of a message
export const SPEECH_RATE = 24000; // Hz
export const EXPRESSION_FPS = 25; // rows per second
export const MAX_TEXT_FRAME = 16384; // bytes
export const MAX_BINARY_FRAME = 65536; // bytes
export const MAX_RATE = 100; // messages per second
export const MAX_BURST = 200; // messages
export const RESUME_SECONDS = 30;
export const MAX_AHEAD_SECONDS = 2;

/** One of the three services that make the conversation. */
export interface Service {
  /** For the visitor's eyes. */
  name: string;
  /** True for the small offline ones that the page says plainly are in use. */
  stand_in: boolean;
}

/** Who listens, thinks and speaks. */
export interface Services {
  /** Speech to text. */
  recognition: Service;
  /** Question to answer. */
  language: Service;
  /** Text to speech. */
  voice: Service;
}

/** The visitor's browser is to recognise speech, besides sending it. */
export interface Dictation {
  /** BCP 47 tag of what is spoken; empty for the browser's own language. */
  language: string;
  /** Who listens where the browser cannot, for the visitor's eyes; null for nobody. */
  fallback: string | null;
}

/** A service that could do one of the three jobs; the best ones come first. */
export interface Offer {
  /** Which job. */
  kind: "recognition" | "language" | "voice";
  /** Name of the service in settings and wishes. */
  key: string;
  /** For the visitor's eyes, as in `services`. */
  name: string;
  /** What keeps it from working and what would mend it; empty if it works. */
  hindrance: string;
}

/** A gesture to make; times are the utterance's. */
export interface Cue {
  /** Counts the cues of the utterance. */
  number: number;
  /** Of the gesture in the bundle. */
  name: string;
  /** Whether with the other hand. */
  mirror: boolean;
  /** When it begins. */
  begin: number;
  /** When its stroke arrives: on an accent. */
  stroke: number;
  /** Seconds of the gesture's beginning that are left out. */
  skip: number;
}

/** A gesture that is held is let go. */
export interface Release {
  /** Of its cue. */
  number: number;
  /** When hands begin to come down, on the utterance's time. */
  time: number;
}

/** First message of every connection. */
export interface HelloMessage {
  type: "hello";
  /** Protocol version of the page. */
  version: number;
  /** The session to go on with after a dropped connection; null for a new one. */
  session: string | null;
  /** `index` of the last speech message that arrived; -1 when new. */
  last_index: number;
  /** Keys of offers by kind that a new session is to use; heeded where `welcome` offers. */
  wishes: Record<string, string>;
}

/** Sound from the microphone (binary). */
export interface AudioMessage {
  type: "audio";
  /** Index of the first sample since the microphone opened; where it jumps, the page left sound out that the network did not carry. */
  sample: number;
  /** (n,) int16 at 16 kHz, at most 1 s; 20-100 ms serve best. */
  pcm: Int16Array;
  /** The utterance that left the loudspeaker when the last sample was recorded; null in silence. */
  playing: number | null;
  /** Seconds of it that had been heard by then; 0 in silence. */
  position: number;
}

/** A typed question. */
export interface TextMessage {
  type: "text";
  /** What was typed. */
  text: string;
}

/** The visitor wants silence. */
export interface InterruptMessage {
  type: "interrupt";
  /** The utterance to stop; null for whatever speaks. */
  utterance: number | null;
}

/** How far the page has played; every 100-250 ms while it plays, and once at the very end. */
export interface ClockMessage {
  type: "clock";
  /** The utterance that plays. */
  utterance: number;
  /** Seconds of it already heard (output latency included). */
  position: number;
  /** Seconds on the body's own time line; 0 without a body. */
  body_time: number;
}

/** Push to talk: the visitor holds the button or lets it go. While it is held everything that comes from the microphone is one turn, whatever its pauses; letting go ends the turn at once. */
export interface TalkMessage {
  type: "talk";
  /** True when the button goes down. */
  pressed: boolean;
}

/** What the browser's recogniser understood, where `welcome` asked for it. */
export interface HeardMessage {
  type: "heard";
  /** Counts up behind each final text; while it stays, a text replaces the last one. */
  result: number;
  /** All words of this result so far. */
  text: string;
  /** Whether they stay as they are. */
  final: boolean;
}

/** The browser cannot recognise speech after all: the server is to do it. */
export interface DeafMessage {
  type: "deaf";
  /** What the browser says about it, for the server's log. */
  reason: string;
}

/** Answer to `hello`. */
export interface WelcomeMessage {
  type: "welcome";
  /** Protocol version of the server. */
  version: number;
  /** Name of the session, to be kept for a resume. */
  session: string;
  /** True if this goes on with the session that `hello` named. */
  resumed: boolean;
  /** Who listens, thinks and speaks. */
  services: Services;
  /** Sentences the page shows once (what this avatar cannot do). */
  notices: string[];
  /** How the browser is to recognise speech; null where the server does. */
  dictation: Dictation | null;
  /** Services to choose from; none where strangers may be talking. */
  offers: Offer[];
}

/** Binary frames of this connection have arrived, whatever became of them. Neither page nor browser can tell otherwise what a network still holds. A page sends sound only a little ahead of what is acknowledged: after a stall no old sound arrives. */
export interface AckMessage {
  type: "ack";
  /** How many so far. */
  frames: number;
}

/** What the avatar does now. */
export interface StateMessage {
  type: "state";
  /** `listening` while the visitor speaks, `thinking` until sound comes, `speaking`. */
  state: "idle" | "listening" | "thinking" | "speaking";
}

/** What the visitor was understood to say. */
export interface TranscriptMessage {
  type: "transcript";
  /** All words of this turn so far. */
  text: string;
  /** False while he still speaks: the next one replaces this one. */
  final: boolean;
}

/** One sentence of the answer, just before its sound. */
export interface AnswerMessage {
  type: "answer";
  /** Counts up by one for each answer in a session. */
  utterance: number;
  /** Where in the utterance its sound starts (24 kHz). */
  first_sample: number;
  /** The sentence. */
  text: string;
}

/** 100-200 ms of sound and the face that belongs to it (binary). Expression row `first_expression` + j belongs to the utterance's time (first_expression + j) / 25 s. */
export interface SpeechMessage {
  type: "speech";
  /** Which answer. */
  utterance: number;
  /** Counts the session's speech messages. */
  index: number;
  /** Of the utterance, at 24 kHz. */
  first_sample: number;
  /** Index in the utterance of the first row. */
  first_expression: number;
  /** (n,) int16 at 24 kHz. */
  pcm: Int16Array;
  /** (rows, B) float16. */
  expressions: Matrix;
}

/** Which body time belongs to which time of the sound, straight between the points. The points go on where those of an earlier message ended; what was planned from the first one's time on is replaced. After the last one the body stays, until the utterance ends. */
export interface TimelineMessage {
  type: "timeline";
  /** Which answer. */
  utterance: number;
  /** (audio time, body time) pairs, seconds, audio time ascending. */
  points: [number, number][];
}

/** What a body on a skeleton does while it speaks; nothing that was sent is taken back. */
export interface CuesMessage {
  type: "cues";
  /** Which answer. */
  utterance: number;
  /** Gestures to make, later ones upon earlier ones. */
  cues: Cue[];
  /** Of these or of earlier ones. */
  releases: Release[];
}

/** All sound of an utterance has been sent. */
export interface EndMessage {
  type: "end";
  /** Which answer. */
  utterance: number;
  /** Length of the utterance at 24 kHz. */
  samples: number;
}

/** Fall silent at once and drop everything that belongs to an utterance. */
export interface StopMessage {
  type: "stop";
  /** Which answer. */
  utterance: number;
}

/** Somebody may speak: fall silent at once, but keep it all; `resume` or `stop` follows. */
export interface PauseMessage {
  type: "pause";
  /** Which answer. */
  utterance: number;
}

/** It was no interruption: go on with the sample at which an utterance fell silent. */
export interface ResumeMessage {
  type: "resume";
  /** Which answer. */
  utterance: number;
}

/** How long something took. */
export interface MetricsMessage {
  type: "metrics";
  /** What was measured. */
  name: string;
  /** Milliseconds by part. */
  values: Record<string, number>;
}

/** Something went wrong. */
export interface ErrorMessage {
  type: "error";
  /** One sentence. */
  message: string;
  /** True if the server closes the connection after it; the session is over. */
  fatal: boolean;
  /** Whether, after a fatal one, a new session may succeed: the page offers to try again. */
  again: boolean;
}

export type ClientMessage =
  | HelloMessage
  | AudioMessage
  | TextMessage
  | InterruptMessage
  | ClockMessage
  | TalkMessage
  | HeardMessage
  | DeafMessage;

export type ServerMessage =
  | WelcomeMessage
  | AckMessage
  | StateMessage
  | TranscriptMessage
  | AnswerMessage
  | SpeechMessage
  | TimelineMessage
  | CuesMessage
  | EndMessage
  | StopMessage
  | PauseMessage
  | ResumeMessage
  | MetricsMessage
  | ErrorMessage;

const SERVER_TYPES = ["welcome", "ack", "state", "transcript", "answer", "speech", "timeline", "cues", "end", "stop", "pause", "resume", "metrics", "error"];

const TENSORS: Record<string, readonly Tensor[]> = {
  audio: [["pcm", "int16"]],
  speech: [["pcm", "int16"], ["expressions", "float16"]],
};

/** A matrix in row order. */
export interface Matrix {
  rows: number;
  columns: number;
  values: Float32Array;
}

/** What is done with each of some messages: the compiler misses none. */
export type Handlers<M extends ServerMessage> = {
  [Type in M["type"]]: (message: Extract<M, { type: Type }>) => void;
};

/** Does what there is to be done with a message. */
export function handle<M extends ServerMessage>(message: M, handlers: Handlers<M>): void {
  (handlers[message.type as M["type"]] as (message: M) => void)(message);
}

type Header = { type: string } & Record<string, unknown>;
type Tensor = readonly [field: string, kind: "int16" | "float16"];

/** A message as a WebSocket frame. */
export function encode(message: ClientMessage): string | ArrayBuffer {
  const header: Header = { ...message };
  const tensors = TENSORS[message.type];
  if (!tensors) return JSON.stringify(header);
  const parts: Int16Array[] = [];
  for (const [field] of tensors) {
    const values = header[field] as Int16Array;
    parts.push(values);
    header[field] = [values.length];
  }
  return joinFrame(new TextEncoder().encode(JSON.stringify(header)), parts);
}

function joinFrame(header: Uint8Array, parts: Int16Array[]): ArrayBuffer {
  const length = parts.reduce((sum, part) => sum + part.byteLength, 4 + header.byteLength);
  const frame = new Uint8Array(length);
  new DataView(frame.buffer).setUint32(0, header.byteLength, true);
  frame.set(header, 4);
  let at = 4 + header.byteLength;
  for (const part of parts) {
    frame.set(new Uint8Array(part.buffer, part.byteOffset, part.byteLength), at);
    at += part.byteLength;
  }
  return frame.buffer;
}

/** A frame as a message; throws an Error on one that is not from this protocol. */
export function decode(frame: string | ArrayBuffer): ServerMessage {
  if (typeof frame === "string") return known(JSON.parse(frame) as Header);
  const length = new DataView(frame).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(frame, 4, length))) as Header;
  let at = 4 + length;
  for (const [field, kind] of TENSORS[header.type] ?? []) {
    const shape = header[field] as number[];
    const bytes = 2 * shape.reduce((product, size) => product * size, 1);
    const words = new Uint16Array(frame.slice(at, at + bytes));
    header[field] = kind === "int16" ? new Int16Array(words.buffer) : matrix(shape, words);
    at += bytes;
  }
  return known(header);
}

function known(header: Header): ServerMessage {
  if (!SERVER_TYPES.includes(header.type)) throw new Error(`unknown message ${header.type}`);
  return header as unknown as ServerMessage;
}

function matrix(shape: number[], words: Uint16Array): Matrix {
  const [rows = 0, columns = 0] = shape;
  return { rows, columns, values: Float32Array.from(words, floatFromHalf) };
}
