// Written by `python -m ico3d.chat.generating`. Edit src/ico3d/chat/wire/protocol.py instead.

export const VERSION = 9;
export const MICROPHONE_RATE = 16000; // Hz
export const MICROPHONE_CHUNK = 512; // samples of a message
export const SPEECH_RATE = 24000; // Hz
export const EXPRESSION_FPS = 25; // rows per second
export const RESUME_SECONDS = 30;
export const BEAT_SECONDS = 1;
export const MAX_TEXT_FRAME = 16384; // bytes
export const MAX_BINARY_FRAME = 65536; // bytes

/** A matrix in row order. */
export interface Matrix {
  rows: number;
  columns: number;
  values: Float32Array;
}

/** An array in the payload of a binary message. */
export type Tensor = readonly [field: string, kind: "int16" | "float16"];

/** One of the three services that make the conversation. */
export interface Service {
  /** Name, as shown to visitors. */
  name: string;
  /** True for one of the simple offline services, about which the page tells visitors. */
  stand_in: boolean;
}

/** The services of the conversation. */
export interface Services {
  /** Speech to text. */
  recognition: Service;
  /** Question to answer. */
  language: Service;
  /** Text to speech. */
  voice: Service;
}

/** Asks the page to let the browser recognise speech, besides sending the sound. */
export interface Dictation {
  /** BCP 47 tag of the spoken language; empty for the browser's language. */
  language: string;
  /** Recogniser for browsers without recognition, as shown to visitors; null for none. */
  fallback: string | null;
}

/** A service that visitors may choose; preferred ones come first. */
export interface Offer {
  /** Kind of the service. */
  kind: "recognition" | "language" | "voice";
  /** Name of the service in settings and wishes. */
  key: string;
  /** Name, as shown to visitors. */
  name: string;
  /** What prevents the service from working and what would help; empty if it works. */
  hindrance: string;
}

/** A sentence that the page shows once, on what this avatar cannot do. */
export interface Notice {
  /** Name of the sentence, by which pages translate it. */
  code: string;
  /** The sentence in English. */
  text: string;
}

/** A gesture to make; times are seconds of the utterance. */
export interface Cue {
  /** Number of the cue in the utterance. */
  number: number;
  /** Name of the gesture in the bundle. */
  name: string;
  /** Whether to make the gesture with the other hand. */
  mirror: boolean;
  /** Time at which the gesture begins. */
  begin: number;
  /** Time at which the stroke arrives, which is that of an accent. */
  stroke: number;
  /** Seconds of the gesture's beginning to leave out. */
  skip: number;
}

/** The end of a gesture that is being held. */
export interface Release {
  /** Number of the gesture's cue. */
  number: number;
  /** Time at which the hands begin to come down, in seconds of the utterance. */
  time: number;
}

/** First message of every connection. */
export interface HelloMessage {
  type: "hello";
  /** Protocol version of the page. */
  version: number;
  /** Id of the session or place in the queue to go on with; null for a new session. */
  session: string | null;
  /** `index` of the last speech message that arrived; -1 for a new session. */
  last_index: number;
  /** Services wished for in a new session: keys of offers, by kind; only offered ones are used. */
  wishes: Record<string, string>;
}

/** What the visitor said in earlier visits, as the browser kept it; once in a new session. Sent only by pages whose visitor agreed; servers refuse it unless `welcome` has `remembers`. */
export interface NotesMessage {
  type: "notes";
  /** The visitor's own sentences, the oldest first. */
  texts: string[];
}

/** Sound from the microphone (binary). */
export interface AudioMessage {
  type: "audio";
  /** Index of the first sample since the microphone was opened; a jump means that the page left out sound that the network could not carry. */
  sample: number;
  /** (n,) int16 at 16 kHz, at most 1 s; 20-100 ms are best. */
  pcm: Int16Array;
  /** Utterance that the loudspeaker was playing when the last sample was recorded; null in silence. */
  playing: number | null;
  /** Seconds of the utterance `playing` that had been heard by then; 0 in silence. */
  position: number;
}

/** A typed question. */
export interface TextMessage {
  type: "text";
  /** The question. */
  text: string;
}

/** A text that the avatar is to say as it is, instead of what it was saying. Servers refuse it unless their settings allow it (`say` in `[embedding]`). */
export interface SayMessage {
  type: "say";
  /** The text. */
  text: string;
}

/** The visitor asks the avatar to be silent. */
export interface InterruptMessage {
  type: "interrupt";
  /** The utterance to stop; null for the current one. */
  utterance: number | null;
}

/** Position of playback; sent every 100-250 ms during playback, and once at the very end. */
export interface ClockMessage {
  type: "clock";
  /** The utterance that is playing. */
  utterance: number;
  /** Seconds of the utterance that have been heard (output latency included). */
  position: number;
  /** Body time in seconds; 0 without a body. */
  body_time: number;
}

/** Push to talk: the visitor presses or releases the button. While the button is held, all sound of the microphone is one turn, whatever its pauses; releasing the button ends the turn at once. */
export interface TalkMessage {
  type: "talk";
  /** True when the button was pressed, false when it was released. */
  pressed: boolean;
}

/** Transcript of the browser's recogniser, if `welcome` asked for it. */
export interface HeardMessage {
  type: "heard";
  /** Number of the result, one higher after each final text; a text replaces an earlier one with the same number. */
  result: number;
  /** All words of this result so far. */
  text: string;
  /** Whether the words will not change any more. */
  final: boolean;
}

/** The browser cannot recognise speech after all, so the server has to. */
export interface DeafMessage {
  type: "deaf";
  /** The browser's error, for the server's log. */
  reason: string;
}

/** Answer to `hello`. */
export interface WelcomeMessage {
  type: "welcome";
  /** Protocol version of the server. */
  version: number;
  /** Id of the session, needed to resume it. */
  session: string;
  /** True if the session is the one that `hello` named. */
  resumed: boolean;
  /** The services of the conversation. */
  services: Services;
  /** What this avatar cannot do. */
  notices: Notice[];
  /** How the browser is to recognise speech; null if the server does. */
  dictation: Dictation | null;
  /** Services to choose from; empty where strangers may be talking. */
  offers: Offer[];
  /** Whether the language model takes `notes` of earlier visits. */
  remembers: boolean;
}

/** All places are taken: the page is in a queue, and `welcome` follows when it is its turn. */
export interface PlaceMessage {
  type: "place";
  /** Id by which the page takes its place in the queue again after a lost connection. */
  session: string;
  /** Position in the queue; 1 is the front. */
  position: number;
  /** Estimate of the time until it is this page's turn; null if nothing is known. */
  seconds: number | null;
}

/** Number of binary frames of this connection that have arrived, whether used or not. Neither page nor browser can otherwise tell what a network still holds. A page sends sound only slightly ahead of what is acknowledged, so that no old sound arrives after a stall. */
export interface AckMessage {
  type: "ack";
  /** Number of frames so far. */
  frames: number;
}

/** The line is up; sent from `welcome` on wherever nothing else was sent for a second. Nobody tells a browser of a network that has gone without a word. A page that hears nothing for some seconds says so and tries another connection. */
export interface BeatMessage {
  type: "beat";
}

/** The avatar's state. */
export interface StateMessage {
  type: "state";
  /** `listening` while the visitor speaks, `thinking` until sound comes, `speaking`. */
  state: "idle" | "listening" | "thinking" | "speaking";
}

/** The visitor's words, as recognised. */
export interface TranscriptMessage {
  type: "transcript";
  /** All words of this turn so far. */
  text: string;
  /** False while the visitor is still speaking; the next transcript then replaces this one. */
  final: boolean;
}

/** One sentence of the answer, sent just before its sound. */
export interface AnswerMessage {
  type: "answer";
  /** Number of the answer, one higher for each answer in a session. */
  utterance: number;
  /** Index of the sentence's first sample in the utterance, at 24 kHz. */
  first_sample: number;
  /** The sentence. */
  text: string;
}

/** When the words of a sentence are spoken; it comes once all of the sentence's sound is made. */
export interface SpokenMessage {
  type: "spoken";
  /** Number of the answer. */
  utterance: number;
  /** That of the sentence's `answer`, which may come before or after. */
  first_sample: number;
  /** Index of each word's first character (code point) in the sentence, ascending. */
  starts: number[];
  /** When each word begins, seconds of the utterance, ascending. */
  times: number[];
}

/** 100-200 ms of sound with the matching face (binary). Expression row `first_expression` + j belongs to the utterance's time (first_expression + j) / 25 s. */
export interface SpeechMessage {
  type: "speech";
  /** Number of the answer. */
  utterance: number;
  /** Number of this speech message in the session. */
  index: number;
  /** Index of the first sample in the utterance, at 24 kHz. */
  first_sample: number;
  /** Index of the first row of expressions in the utterance. */
  first_expression: number;
  /** (n,) int16 at 24 kHz. */
  pcm: Int16Array;
  /** (rows, B) float16. */
  expressions: Matrix;
}

/** Body time over the time of the sound, linear between points. The points continue those of earlier messages; earlier points from the first new one's time on are replaced. After the last point the body stands still until the utterance ends. */
export interface TimelineMessage {
  type: "timeline";
  /** Number of the answer. */
  utterance: number;
  /** Pairs (audio time, body time) in seconds, ascending in audio time. */
  points: [number, number][];
}

/** Gestures of a body on a skeleton during speech; cues that were sent are never withdrawn. */
export interface CuesMessage {
  type: "cues";
  /** Number of the answer. */
  utterance: number;
  /** Gestures to make; later ones are blended over earlier ones. */
  cues: Cue[];
  /** Releases of gestures in this or in earlier messages. */
  releases: Release[];
}

/** The language model calls a function: a tool of the settings, a gesture or a mood. */
export interface CallMessage {
  type: "call";
  /** Name of the function. */
  name: string;
  /** Arguments as a JSON object; `{}` if they would be too long. */
  arguments: string;
}

/** All sound of an utterance has been sent. */
export interface EndMessage {
  type: "end";
  /** Number of the answer. */
  utterance: number;
  /** Length of the utterance at 24 kHz. */
  samples: number;
}

/** The page must fall silent at once and drop everything about an utterance. */
export interface StopMessage {
  type: "stop";
  /** Number of the answer. */
  utterance: number;
}

/** Somebody may be speaking: the page falls silent at once but keeps the utterance. A message `resume` or `stop` follows. */
export interface PauseMessage {
  type: "pause";
  /** Number of the answer. */
  utterance: number;
}

/** There was no interruption: the page continues at the sample where it fell silent. */
export interface ResumeMessage {
  type: "resume";
  /** Number of the answer. */
  utterance: number;
}

/** Measured durations. */
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
  /** One sentence for the visitor, in English. */
  message: string;
  /** True if the session is over and the server closes the connection. */
  fatal: boolean;
  /** After a fatal error: whether a new session may succeed, so that the page offers one. */
  again: boolean;
  /** Name of the sentence, by which pages translate it; empty for one without. */
  code: string;
  /** Numbers in the sentence, by name. */
  values: Record<string, number>;
}

export type ClientMessage = HelloMessage | NotesMessage | AudioMessage | TextMessage | SayMessage | InterruptMessage | ClockMessage | TalkMessage | HeardMessage | DeafMessage;

export type ServerMessage = WelcomeMessage | PlaceMessage | AckMessage | BeatMessage | StateMessage | TranscriptMessage | AnswerMessage | SpokenMessage | SpeechMessage | TimelineMessage | CuesMessage | CallMessage | EndMessage | StopMessage | PauseMessage | ResumeMessage | MetricsMessage | ErrorMessage;

/** The arrays of binary messages, in order. */
export const TENSORS: Record<string, readonly Tensor[]> = {
  audio: [["pcm", "int16"]],
  speech: [["pcm", "int16"], ["expressions", "float16"]],
};
