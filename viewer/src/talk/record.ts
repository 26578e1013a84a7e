import type { Progress } from './captioning.ts';

/** What somebody said. */
export interface Entry {
  who: 'you' | 'avatar';
  at: Date;
  text: string;
  /** Whether the avatar was interrupted before the end. */
  cut: boolean;
}

/** What is told of a record. */
export interface RecordEvents {
  /** An entry of this talk is new, or has changed. */
  changed(entry: Entry): void;
  /** The oldest entry of this talk makes room for others. */
  dropped(entry: Entry): void;
  /** Another talk begins, or what was said is shown no more. */
  renewed(): void;
}

const CUT = ' …';
const ENDED = /[.!?。！？…]["'”’»)]*\s*$/; // answers come clause by clause
const JOINED = /[\u3000-\u3029\u3030-\u3098\u309b-\u30ff\u3400-\u9fff\uff00-\uff9d\uffa0-\uffef]/; // of scripts that put no spaces between sentences, but no marks
const MOST_ENTRIES = 1000;
/** Entries of talks before this one. */
const MOST_EARLIER = 200;
/** Letters of all entries of this talk, and of all of talks before it. */
const MOST_IN_ALL = 200_000;
/** Letters of an answer that are kept, and clauses of a sentence that goes on: servers say 4,000 at most. */
const MOST_LETTERS = 8000;
const MOST_BEFORE = 4000;

/** All that was said in a talk, as far as it was heard, and in the talks before it. */
export class TalkRecord {
  entries: Entry[] = [];
  /** Of talks before this one, which is another one for the avatar. */
  earlier: readonly Entry[];
  private readonly events: RecordEvents;
  private answer: { utterance: number; entry: Entry; sentences: Map<number, Progress>; letters: number } | null = null;
  private letters = 0; // of all entries
  private resumed = false; // and nothing new was said
  private closed = false; // the talk is over, and another visitor may begin the next one

  /** @param earlier what was said before the page was loaded anew */
  constructor(events: RecordEvents, earlier: readonly Entry[] = []) {
    this.events = events;
    this.earlier = earlier;
  }

  /** What stays for this visitor when another talk begins: talks in which they said something. */
  get lasting(): readonly Entry[] {
    if (this.closed) return [];
    return this.entries.some(({ who }) => who === 'you') ? newest([...this.earlier, ...this.entries], MOST_EARLIER, MOST_IN_ALL) : this.earlier;
  }

  /** The visitor has asked; after a lost connection the server may repeat the last question. */
  asked(text: string): void {
    const last = this.entries.findLast(({ who }) => who === 'you');
    const repeated = this.resumed && last?.text === text;
    this.resumed = false;
    if (!repeated && text.trim()) this.add({ who: 'you', at: new Date(), text, cut: false });
  }

  /** More of a sentence has been heard. */
  heard(progress: Progress): void {
    if (this.answer?.utterance !== progress.utterance) {
      const entry: Entry = { who: 'avatar', at: new Date(), text: '', cut: false };
      this.answer = { utterance: progress.utterance, entry, sentences: new Map(), letters: 0 };
    }
    const { entry, sentences } = this.answer;
    const before = sentences.get(progress.first)?.text.length ?? -1; // also a sentence of nothing takes room
    const letters = this.answer.letters + progress.text.length - before;
    if (letters > MOST_LETTERS) return;
    this.answer.letters = letters;
    sentences.set(progress.first, progress);
    const had = entry.text.length;
    entry.text = joined([...sentences.values()].map(({ text, heard }) => text.slice(0, heard).trim()));
    if (!entry.text) return;
    if (this.entries.includes(entry)) this.tell(entry, entry.text.length - had);
    else this.add(entry);
  }

  /** No more of an utterance is heard. */
  over(utterance: number, interrupted: boolean): void {
    if (this.answer?.utterance !== utterance) return;
    const { entry, sentences } = this.answer;
    const last = [...sentences.values()].at(-1)!;
    this.answer = null;
    if (!interrupted || !entry.text || (last.heard === last.text.length && ENDED.test(last.text))) return;
    entry.cut = true;
    entry.text += CUT;
    this.tell(entry, CUT.length);
  }

  /** The last answer, as far as it was heard. */
  get answered(): string {
    return this.entries.findLast(({ who }) => who === 'avatar')?.text ?? '';
  }

  /** Whether an answer is being heard. */
  get isOpen(): boolean {
    return this.answer !== null;
  }

  /** A session goes on, or a new one begins. */
  begin(resumed: boolean): void {
    this.resumed = resumed;
    if (!resumed) this.renew(this.lasting);
  }

  /** The server has ended the talk: whoever begins the next one may be somebody else. */
  close(): void {
    this.closed = true;
  }

  /** Forgets all that was said. */
  clear(): void {
    this.renew([]);
  }

  private renew(earlier: readonly Entry[]): void {
    this.earlier = earlier;
    this.closed = false;
    this.answer = null;
    this.entries = [];
    this.letters = 0;
    this.events.renewed();
  }

  private add(entry: Entry): void {
    this.entries.push(entry);
    this.tell(entry, entry.text.length);
  }

  /** Tells of an entry that has so many letters more; the oldest ones make room for it. */
  private tell(entry: Entry, letters: number): void {
    this.letters += letters;
    this.events.changed(entry);
    while (this.entries.length > 1 && (this.entries.length > MOST_ENTRIES || this.letters > MOST_IN_ALL)) {
      const oldest = this.entries.shift()!;
      this.letters -= oldest.text.length;
      this.events.dropped(oldest);
    }
  }
}

/** The newest entries: so many at most, and with so many letters. */
export function newest(entries: readonly Entry[], most: number, letters: number): readonly Entry[] {
  let [first, left] = [entries.length, letters];
  while (first > Math.max(0, entries.length - most) && (left -= entries[first - 1]!.text.length) >= 0) first -= 1;
  return entries.slice(first);
}

/** A sentence as far as it has come, of which some units may not have been heard. */
export type Heard = Pick<Progress, 'text' | 'heard'>;

/**
 * Puts the clauses of a sentence together: answers come clause by clause, and a reader who sees
 * the last clause alone has lost the beginning.
 */
export class RunningSentence {
  private before = ''; // clauses of the sentence that were spoken before the present one
  private present: Progress | null = null;

  /** More of a clause has been heard; gives the whole sentence up to its end. */
  follow(progress: Progress): Heard {
    const { present } = this;
    if (present && (present.utterance !== progress.utterance || present.first !== progress.first)) {
      const follows = present.utterance === progress.utterance && present.first < progress.first; // numbers may start anew
      const goesOn = follows && !ENDED.test(present.text);
      this.before = goesOn ? joined([this.before, present.text.trim()]).slice(-MOST_BEFORE) : '';
    }
    this.present = progress;
    const text = joined([this.before, progress.text]);
    return { text, heard: text.length - progress.text.length + progress.heard };
  }
}

function joined(sentences: readonly string[]): string {
  const said = sentences.filter(Boolean);
  return said.map((sentence, i) => (i === 0 || JOINED.test(said[i - 1]!.at(-1)!) ? sentence : ` ${sentence}`)).join('');
}
