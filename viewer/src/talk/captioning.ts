import { atEnd } from '../lifetime.ts';
import { SPEECH_RATE, type AnswerMessage, type SpokenMessage } from '../protocol.ts';

const PERIOD = 50; // ms between looks at what is heard
const LETTERS = 14; // of a word, spoken per second, until the times of words are known
const IDEOGRAPHS = 5;
const IDEOGRAPH = /[\u3040-\u30ff\u3400-\u9fff]/g;

/** A word of a sentence: index of its first UTF-16 unit, and when it begins, s of the utterance. */
interface Word {
  start: number;
  time: number;
}

interface Sentence {
  utterance: number;
  first: number; // sample
  text: string;
  words: readonly Word[];
}

/** How much of a sentence has been heard. */
export interface Progress {
  utterance: number;
  /** Index of the sentence's first sample: its name in the utterance. */
  first: number;
  text: string;
  /** Number of UTF-16 units of the text up to the word that is being spoken, and that word. */
  heard: number;
}

/** What is told of captions. */
export interface CaptionEvents {
  heard(progress: Progress): void;
  /** No more of an utterance is heard: it was said to its end, or was interrupted. */
  over(utterance: number, interrupted: boolean): void;
}

/** Sentences that wait to be spoken; of more, the first are forgotten. */
const MOST_SENTENCES = 1000;

/** Follows the words of the answers by the clock of the sound. */
export class Captioning {
  private readonly position: () => { utterance: number; seconds: number } | null;
  private readonly events: CaptionEvents;
  private sentences: Sentence[] = []; // not yet over, in the order in which they are spoken
  private readonly times = new Map<string, SpokenMessage>(); // of sentences that have not come
  private shown: Progress | null = null;
  private timer: ReturnType<typeof setInterval> | undefined;

  /** @param position what leaves the loudspeaker: utterance, and seconds of it */
  constructor(position: Captioning['position'], events: CaptionEvents, signal: AbortSignal) {
    this.position = position;
    this.events = events;
    atEnd(signal, () => this.reset());
  }

  /** A sentence is about to be spoken; one with the same number replaces it. */
  answer({ utterance, first_sample, text }: AnswerMessage): void {
    const key = nameOf(utterance, first_sample);
    const times = this.times.get(key);
    this.times.delete(key);
    this.sentences = this.sentences.filter((one) => one.utterance !== utterance || one.first !== first_sample).slice(1 - MOST_SENTENCES);
    const words = times ? timed(text, times) : estimated(text, first_sample / SPEECH_RATE);
    this.sentences.push({ utterance, first: first_sample, text, words });
    this.timer ??= setInterval(() => this.look(), PERIOD);
  }

  /** When the words of a sentence are spoken, as the server knows it. */
  spoken(message: SpokenMessage): void {
    const sentence = this.sentences.find((one) => one.utterance === message.utterance && one.first === message.first_sample);
    if (sentence) sentence.words = timed(sentence.text, message);
    else if (this.times.size < MOST_SENTENCES) this.times.set(nameOf(message.utterance, message.first_sample), message);
  }

  /** An utterance was heard to its end. */
  finish(utterance: number): void {
    for (const sentence of this.sentences.filter((one) => one.utterance === utterance)) this.tell(sentence, sentence.text.length);
    this.end(utterance, false);
  }

  /** An utterance was interrupted; by default all are. */
  stop(utterance = this.sentences.at(-1)?.utterance): void {
    this.look();
    if (utterance !== undefined) this.end(utterance, true);
  }

  /** Utterances are counted from the start again. */
  reset(): void {
    this.stop();
    this.times.clear();
  }

  private end(last: number, interrupted: boolean): void {
    const over = new Set(this.sentences.map(({ utterance }) => utterance).filter((utterance) => utterance <= last));
    this.sentences = this.sentences.filter(({ utterance }) => utterance > last);
    for (const key of [...this.times.keys()]) if (Number(key.split(' ')[0]) <= last) this.times.delete(key);
    for (const utterance of over) this.events.over(utterance, interrupted);
    if (this.shown && this.shown.utterance <= last) this.shown = null;
    if (this.sentences.length > 0) return;
    clearInterval(this.timer);
    this.timer = undefined;
  }

  /** Tells of all sentences of the utterance that is heard, up to the present one. */
  private look(): void {
    const at = this.position();
    if (!at) return;
    const begun = this.sentences.filter(({ utterance, first }) => utterance === at.utterance && first / SPEECH_RATE <= at.seconds);
    const from = begun.findIndex(({ first }) => first === this.shown?.first && at.utterance === this.shown.utterance);
    const news = begun.slice(Math.max(0, from));
    news.forEach((sentence, i) => this.tell(sentence, i < news.length - 1 ? sentence.text.length : heardBy(sentence, at.seconds)));
  }

  private tell({ utterance, first, text }: Sentence, heard: number): void {
    const { shown } = this;
    const same = shown?.utterance === utterance && shown.first === first;
    if (same && shown.heard >= heard) return; // nothing that was shown goes again
    this.shown = { utterance, first, text, heard };
    this.events.heard(this.shown);
  }
}

const nameOf = (utterance: number, first: number) => `${utterance} ${first}`;

function heardBy({ words, text }: Sentence, seconds: number): number {
  const next = words.findIndex(({ time }) => time > seconds);
  if (next === -1) return text.length;
  return next === 0 ? 0 : words[next]!.start;
}

/** The server counts code points, texts of a browser UTF-16 units. */
function timed(text: string, { starts, times }: SpokenMessage): Word[] {
  const units = [0];
  for (const point of text) units.push(units.at(-1)! + point.length);
  return starts.map((start, i) => ({ start: units[start] ?? text.length, time: times[i]! }));
}

/**
 * Words at a usual pace.
 *
 * @param begin when the sentence begins, s
 */
export function estimated(text: string, begin: number): Word[] {
  const words = [...new Intl.Segmenter(undefined, { granularity: 'word' }).segment(text)].filter(({ isWordLike }) => isWordLike);
  let time = begin;
  return words.map(({ segment, index }) => {
    const word = { start: index, time };
    const ideographs = segment.match(IDEOGRAPH)?.length ?? 0;
    time += ideographs / IDEOGRAPHS + (segment.length - ideographs + 1) / LETTERS; // one for the space
    return word;
  });
}
