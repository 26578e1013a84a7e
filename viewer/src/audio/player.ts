import { EXPRESSION_FPS, SPEECH_RATE, type SpeechMessage } from '../protocol.ts';
import { ExpressionTrack } from '../face/track.ts';
import type { Heard } from '../face/face.ts';
import { heardTime } from './clock.ts';
import { Schedule } from './schedule.ts';

const GUARD = 0.02; // s: a start nearer than this may miss the block that is being rendered
const LEAD = 0.05; // s more for a first piece: room for the next one to be late
const FADE = 0.02; // s to silence when stopped

/** 100–200 ms of an utterance: sound and face. */
export type Piece = Omit<SpeechMessage, 'type' | 'index'>;

interface Voice {
  utterance: number;
  schedule: Schedule;
  track: ExpressionTrack;
  gain: GainNode;
  sources: Set<AudioBufferSourceNode>;
  samples: number | null; // in all, once the server has said it
}

/** Plays utterances gaplessly on the AudioContext clock and says what is heard. */
export class Player {
  readonly context: AudioContext;
  readonly output: GainNode;
  onStart: (utterance: number, delay: number) => void = () => {};
  onFinish: (utterance: number, seconds: number) => void = () => {};
  private voices: Voice[] = []; // in the order in which they speak
  private lastDropped = -1;

  constructor() {
    // At the speech's own rate no piece is resampled on its own: pieces join exactly.
    this.context = new AudioContext({ sampleRate: SPEECH_RATE, latencyHint: 'interactive' });
    this.output = new GainNode(this.context);
    this.output.connect(this.context.destination);
  }

  /** Schedules a piece; pieces of a stopped utterance are dropped. */
  play(piece: Piece): void {
    if (piece.utterance <= this.lastDropped) return;
    const voice = this.voices.find((v) => v.utterance === piece.utterance) ?? this.open(piece.utterance);
    voice.track.add(piece.first_expression, piece.expressions);
    if (piece.pcm.length === 0) return;
    const previous = this.voices[this.voices.indexOf(voice) - 1];
    const now = Math.ceil((this.context.currentTime + GUARD) * SPEECH_RATE);
    const first = voice.schedule.end === 0;
    const start = voice.schedule.place(piece.first_sample, piece.pcm.length, now, previous?.schedule.end);
    this.sound(voice, piece.pcm, start);
    if (first) this.onStart(piece.utterance, start / SPEECH_RATE - this.heardNow());
  }

  /** The server has sent all of an utterance. */
  end(utterance: number, samples: number): void {
    const voice = this.voices.find((v) => v.utterance === utterance);
    if (voice) voice.samples = samples;
  }

  /** Fades an utterance out at once and drops all that belongs to it, also what is yet to come. */
  stop(utterance: number): void {
    this.lastDropped = Math.max(this.lastDropped, utterance);
    for (const voice of this.voices.filter((v) => v.utterance <= utterance)) this.silence(voice);
    this.voices = this.voices.filter((v) => v.utterance > utterance);
  }

  /** A new session counts its utterances from the start. */
  reset(): void {
    for (const voice of this.voices) this.silence(voice);
    this.voices = [];
    this.lastDropped = -1;
  }

  /** The utterance that leaves the loudspeaker now and how far it has come. */
  heard(): Heard | null {
    const frame = this.heardNow() * SPEECH_RATE;
    this.retire(frame);
    const voice = this.voices.findLast((v) => v.schedule.start <= frame);
    if (!voice || voice.track.empty) return null;
    const seconds = voice.schedule.positionAt(frame) / SPEECH_RATE;
    return { utterance: voice.utterance, seconds, track: voice.track };
  }

  /** The newest utterance that has not ended or been stopped. */
  get current(): number | null {
    return this.voices.at(-1)?.utterance ?? null;
  }

  /** Seconds of silence that late pieces have put into the current utterance. */
  get underrun(): number {
    return (this.voices.at(-1)?.schedule.shifted ?? 0) / SPEECH_RATE;
  }

  private heardNow(): number {
    return heardTime(this.context, performance.now());
  }

  private open(utterance: number): Voice {
    const gain = new GainNode(this.context);
    gain.connect(this.output);
    const voice: Voice = {
      utterance,
      schedule: new Schedule(Math.round(LEAD * SPEECH_RATE)),
      track: new ExpressionTrack(EXPRESSION_FPS),
      gain,
      sources: new Set(),
      samples: null,
    };
    this.voices.push(voice);
    return voice;
  }

  private sound(voice: Voice, pcm: Int16Array, start: number): void {
    const buffer = new AudioBuffer({ length: pcm.length, sampleRate: SPEECH_RATE, numberOfChannels: 1 });
    buffer.copyToChannel(Float32Array.from(pcm, (value) => value / 0x8000), 0);
    const source = new AudioBufferSourceNode(this.context, { buffer });
    source.connect(voice.gain);
    source.start(start / SPEECH_RATE);
    voice.sources.add(source);
    source.onended = () => voice.sources.delete(source);
  }

  private silence(voice: Voice): void {
    const now = this.context.currentTime;
    voice.gain.gain.setValueAtTime(1, now).linearRampToValueAtTime(0, now + FADE);
    for (const source of voice.sources) source.stop(now + FADE);
  }

  /** Forgets utterances that were heard to their end. */
  private retire(frame: number): void {
    const [voice] = this.voices;
    if (!voice || voice.samples === null || voice.schedule.positionAt(frame) < voice.samples) return;
    this.voices.shift();
    this.onFinish(voice.utterance, voice.samples / SPEECH_RATE);
  }
}
