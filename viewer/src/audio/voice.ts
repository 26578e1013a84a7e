import { EXPRESSION_FPS, SPEECH_RATE, type SpeechMessage } from '../protocol.ts';
import { ExpressionTrack } from '../face/track.ts';
import { Schedule } from './schedule.ts';

const LEAD = Math.round(0.05 * SPEECH_RATE); // more for a first piece: room for the next one to be late
/** Frames from full sound to silence and back. */
export const FADE = Math.round(0.008 * SPEECH_RATE); // with the guard before it, silence comes within 30 ms

/** 100–200 ms of an utterance: sound and face. */
export type Piece = Omit<SpeechMessage, 'type' | 'index'>;

/** What a voice needs of the audio context. */
export interface Sink {
  /** The first frame for which something can still be scheduled. */
  now(): number;
  /** Plays sound from a frame on; returns a function that ends it on the frame it is given. */
  play(pcm: Int16Array, start: number): (end: number) => void;
  /** Changes the volume from a frame on, within FADE frames. */
  fade(from: number, to: number, start: number): void;
}

interface Part {
  first: number; // sample of the utterance
  pcm: Int16Array;
  end: number; // frame after its last one
  stop: (frame: number) => void;
}

/** One utterance: what of it sounds when. It can fall silent and go on with the sample it stopped at. */
export class Voice {
  readonly utterance: number;
  readonly track = new ExpressionTrack(EXPRESSION_FPS);
  readonly schedule = new Schedule(LEAD);
  samples: number | null = null; // in all, once the server has said it
  private readonly sink: Sink;
  private parts: Part[] = []; // that sound or will
  private waiting: { first: number; pcm: Int16Array }[] = []; // while it is paused
  private held: number | null = null; // sample with which it goes on

  constructor(utterance: number, sink: Sink) {
    this.utterance = utterance;
    this.sink = sink;
  }

  get paused(): boolean {
    return this.held !== null;
  }

  /**
   * Schedules a piece.
   *
   * @param earliest frame before which nothing may start (another utterance still speaks)
   */
  add({ first_expression, expressions, first_sample: first, pcm }: Piece, earliest = 0): void {
    this.track.add(first_expression, expressions);
    if (pcm.length === 0) return;
    if (this.paused) this.waiting.push({ first, pcm });
    else this.place(first, pcm, earliest);
  }

  /** Falls silent at once; nothing is lost. */
  pause(): void {
    if (this.paused) return;
    const now = this.sink.now();
    this.held = this.schedule.cut(now);
    this.waiting = this.parts.filter(({ end }) => end > now);
    this.silence();
  }

  /** Goes on with the sample at which it began to fade. */
  resume(): void {
    if (this.held === null) return;
    const { held, waiting } = this;
    this.held = null;
    this.waiting = [];
    const starts = waiting.map(({ first, pcm }) => {
      const skip = Math.max(0, held - first);
      return this.place(first + skip, skip > 0 ? pcm.subarray(skip) : pcm, 0);
    });
    this.sink.fade(0, 1, starts[0] ?? this.sink.now());
  }

  /** Fades out and drops what is scheduled. */
  silence(): void {
    const now = this.sink.now();
    if (this.parts.length > 0) this.sink.fade(1, 0, now);
    for (const { stop } of this.parts) stop(now + FADE);
    this.parts = [];
  }

  private place(first: number, pcm: Int16Array, earliest: number): number {
    const now = this.sink.now();
    const start = this.schedule.place(first, pcm.length, now, earliest);
    this.parts = this.parts.filter(({ end }) => end > now - FADE);
    this.parts.push({ first, pcm, end: start + pcm.length, stop: this.sink.play(pcm, start) });
    return start;
  }
}
