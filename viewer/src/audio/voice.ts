import { EXPRESSION_FPS, SPEECH_RATE, type SpeechMessage } from '../protocol.ts';
import { ExpressionTrack } from '../face/track.ts';
import { Schedule } from './schedule.ts';

const LEAD = Math.round(0.05 * SPEECH_RATE); // more for a first piece: room for the next one to be late
/** Frames from full sound to silence and back. */
export const FADE = Math.round(0.008 * SPEECH_RATE); // with the guard before it, silence comes within 30 ms

/** Samples of the longest utterance: 20 minutes. What lies beyond is not played. */
const LONGEST = 1200 * SPEECH_RATE;
/** Samples that what goes on after a pause is joined to, so that pauses cost the same however small its pieces were. */
const STRETCH = 10 * SPEECH_RATE;
/** Stretches that go on after a pause: an honest utterance has no gaps, so 64 are more than ten minutes. */
const MOST_STRETCHES = 64;

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

interface Sound {
  first: number; // sample of the utterance
  pcm: Int16Array;
}

interface Part extends Sound {
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
  private waiting: Sound[] = []; // while it is paused
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
    if (pcm.length === 0 || first + pcm.length > LONGEST) return;
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
    const starts = stretches(waiting).map(({ first, pcm }) => {
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

/** Pieces joined where one follows the other. */
function stretches(pieces: Sound[]): Sound[] {
  const groups: Sound[][] = [];
  let end = NaN; // sample after the newest one
  let length = 0; // of the newest group
  for (const piece of pieces) {
    const follows = piece.first === end && length + piece.pcm.length <= STRETCH;
    if (!follows && groups.length === MOST_STRETCHES) break;
    if (follows) groups.at(-1)!.push(piece);
    else groups.push([piece]);
    length = (follows ? length : 0) + piece.pcm.length;
    end = piece.first + piece.pcm.length;
  }
  return groups.map(joined);
}

/** One piece stays the same object: whoever plays it again has it ready. */
function joined(group: Sound[]): Sound {
  const [head] = group as [Sound];
  if (group.length === 1) return head;
  const pcm = new Int16Array(group.reduce((sum, one) => sum + one.pcm.length, 0));
  for (const one of group) pcm.set(one.pcm, one.first - head.first);
  return { first: head.first, pcm };
}
