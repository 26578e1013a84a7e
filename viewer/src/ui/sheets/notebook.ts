import { forget, remember, remembered } from '../../remembered.ts';
import { MAX_NOTE, MAX_NOTES } from '../../shared.ts';

const LEAST_WORDS = 2; // "yes" says nothing at the next visit

/** What the browser keeps: the visitor's decision, and their own sentences, the oldest first. */
interface Kept {
  agreed: boolean;
  notes: string[];
}

/** What a visitor who agreed has said in earlier visits: in this browser alone, for the avatars of one address. */
export class Notebook {
  private readonly key: string;

  /** @param home address of the avatar's server: others are not told */
  constructor(home: string) {
    this.key = `visits-${home}`;
  }

  /** Whether the visitor agreed; null for one who was not asked. */
  get agreed(): boolean | null {
    return this.read()?.agreed ?? null;
  }

  get notes(): readonly string[] {
    return this.read()?.notes ?? [];
  }

  /** The visitor agrees, or does not; then nothing of before is left. */
  decide(agreed: boolean): void {
    this.write({ agreed, notes: agreed ? [...this.notes] : [] });
  }

  /** The visitor has said something; without their consent it is not kept. */
  said(text: string): void {
    const note = tidy(text);
    if (!this.agreed || countWords(note) < LEAST_WORDS) return;
    const others = this.notes.filter((other) => other !== note);
    if (note.startsWith(others.at(-1) ?? note)) others.pop(); // the same turn, of which more has been heard
    this.write({ agreed: true, notes: [...others, note].slice(-MAX_NOTES) });
  }

  /** Deletes a sentence, or all. */
  delete(note?: string): void {
    this.write({ agreed: this.agreed ?? false, notes: note === undefined ? [] : this.notes.filter((other) => other !== note) });
  }

  private read(): Kept | null {
    return keptIn(remembered(this.key));
  }

  private write(kept: Kept): void {
    forget(this.key); // what is new may not fit beside it
    remember(this.key, JSON.stringify(kept));
  }
}

/** What a browser kept, if it is that: others may have written there. */
function keptIn(text: string | null): Kept | null {
  try {
    const { agreed, notes } = JSON.parse(text ?? '') as Partial<Record<keyof Kept, unknown>>;
    if (typeof agreed !== 'boolean' || !Array.isArray(notes)) return null;
    const texts = notes.filter((note) => typeof note === 'string').map(tidy).filter(Boolean);
    return { agreed, notes: agreed ? texts.slice(-MAX_NOTES) : [] };
  } catch {
    return null;
  }
}

/** A sentence in one line, as long as the server takes it. */
function tidy(text: string): string {
  const line = text.replace(/[\s\p{Cc}\p{Cs}]+/gu, ' ').trim();
  return [...line].slice(0, MAX_NOTE).join('').trim();
}

function countWords(text: string): number {
  return [...new Intl.Segmenter(undefined, { granularity: 'word' }).segment(text)].filter(({ isWordLike }) => isWordLike).length;
}
