import { SPEECH_RATE } from '../protocol.ts';
import type { Heard } from '../face/face.ts';
import { heardTime } from './clock.ts';
import { FADE, Voice, type Piece, type Sink } from './voice.ts';

const GUARD = 0.02; // s: a start nearer than this may miss the block that is being rendered

/** Plays utterances gaplessly on the AudioContext clock and says what is heard. */
export class Player {
  readonly context: AudioContext;
  readonly output: GainNode;
  onStart: (utterance: number, delay: number) => void = () => {};
  onFinish: (utterance: number, seconds: number) => void = () => {};
  private voices: Voice[] = []; // in the order in which they speak
  private lastDropped = -1;
  private readonly buffers = new WeakMap<Int16Array, AudioBuffer>(); // of pieces: who is interrupted goes on with the same ones

  constructor() {
    // At the speech's own rate no piece is resampled on its own: pieces join exactly.
    this.context = new AudioContext({ sampleRate: SPEECH_RATE, latencyHint: 'interactive' });
    this.output = new GainNode(this.context);
    this.output.connect(this.context.destination);
  }

  /** Lets all sound go through a node on its way to the loudspeaker, or straight there again. */
  through(node: AudioNode | null): void {
    this.output.disconnect();
    this.output.connect(node ?? this.context.destination);
    node?.connect(this.context.destination);
  }

  /** Schedules a piece; pieces of a stopped utterance are dropped. */
  play(piece: Piece): void {
    if (piece.utterance <= this.lastDropped) return;
    const voice = this.voices.find((v) => v.utterance === piece.utterance) ?? this.open(piece.utterance);
    const previous = this.voices[this.voices.indexOf(voice) - 1];
    const first = voice.schedule.end === 0 && !voice.paused;
    voice.add(piece, previous?.schedule.end);
    if (first && voice.schedule.end > 0) this.onStart(piece.utterance, voice.schedule.start / SPEECH_RATE - this.heardTime(performance.now()));
  }

  /** The server has sent all of an utterance. */
  end(utterance: number, samples: number): void {
    const voice = this.voices.find((v) => v.utterance === utterance);
    if (voice) voice.samples = samples;
  }

  /** An utterance falls silent at once, but goes on where it stopped when it is resumed. */
  pause(utterance: number): void {
    this.voices.find((v) => v.utterance === utterance)?.pause();
  }

  resume(utterance: number): void {
    this.voices.find((v) => v.utterance === utterance)?.resume();
  }

  /** Fades an utterance out at once and drops all that belongs to it, also what is yet to come. */
  stop(utterance: number): void {
    this.lastDropped = Math.max(this.lastDropped, utterance);
    for (const voice of this.voices.filter((v) => v.utterance <= utterance)) voice.silence();
    this.voices = this.voices.filter((v) => v.utterance > utterance);
  }

  /** A new session counts its utterances from the start. */
  reset(): void {
    for (const voice of this.voices) voice.silence();
    this.voices = [];
    this.lastDropped = -1;
  }

  /**
   * The utterance that leaves the loudspeaker and how far it has come.
   *
   * @param at performance.now() of the moment in question, in ms; at most a second ago
   */
  heard(at = performance.now()): Heard | null {
    const frame = this.heardTime(at) * SPEECH_RATE;
    this.retire(frame);
    const voice = this.voices.findLast((v) => v.schedule.start <= frame);
    if (!voice || voice.track.empty) return null;
    const seconds = voice.schedule.positionAt(frame) / SPEECH_RATE;
    return { utterance: voice.utterance, seconds, track: voice.track, paused: voice.paused };
  }

  /** The newest utterance that has not ended or been stopped. */
  get current(): number | null {
    return this.voices.at(-1)?.utterance ?? null;
  }

  /** Seconds of silence that late pieces have put into the current utterance. */
  get underrun(): number {
    return (this.voices.at(-1)?.schedule.shifted ?? 0) / SPEECH_RATE;
  }

  private heardTime(at: number): number {
    return heardTime(this.context, at);
  }

  private open(utterance: number): Voice {
    const voice = new Voice(utterance, this.sink());
    this.voices.push(voice);
    return voice;
  }

  /** A way into the loudspeaker with a volume of its own. */
  private sink(): Sink {
    const { context } = this;
    const node = new GainNode(context);
    node.connect(this.output);
    return {
      now: () => Math.ceil((context.currentTime + GUARD) * SPEECH_RATE),
      play: (pcm, start) => {
        let buffer = this.buffers.get(pcm);
        if (!buffer) this.buffers.set(pcm, (buffer = bufferOf(pcm)));
        const source = new AudioBufferSourceNode(context, { buffer });
        source.connect(node);
        source.start(start / SPEECH_RATE);
        return (end) => source.stop(end / SPEECH_RATE);
      },
      fade: (from, to, start) => {
        node.gain.setValueAtTime(from, start / SPEECH_RATE);
        node.gain.linearRampToValueAtTime(to, (start + FADE) / SPEECH_RATE);
      },
    };
  }

  /** Forgets utterances that were heard to their end. */
  private retire(frame: number): void {
    const [voice] = this.voices;
    if (!voice || voice.samples === null || voice.schedule.positionAt(frame) < voice.samples) return;
    this.voices.shift();
    this.onFinish(voice.utterance, voice.samples / SPEECH_RATE);
  }
}

function bufferOf(pcm: Int16Array): AudioBuffer {
  const buffer = new AudioBuffer({ length: pcm.length, sampleRate: SPEECH_RATE, numberOfChannels: 1 });
  const values = new Float32Array(pcm.length);
  for (let i = 0; i < pcm.length; i++) values[i] = pcm[i]! / 0x8000;
  buffer.copyToChannel(values, 0);
  return buffer;
}
