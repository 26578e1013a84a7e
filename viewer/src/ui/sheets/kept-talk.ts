import { atEnd } from '../../lifetime.ts';
import { forgetInTab, rememberedInTab, rememberInTab } from '../../remembered.ts';
import type { Entry } from '../../talk/record.ts';

const MOST_LINES = 200;
const MOST_UNITS = 60_000; // of UTF-16, as browsers count what they keep; of some millions that a site may have
const SOON = 500; // ms after a change: while she speaks, each word is one

/** A line as it is kept: who, when in ms since 1970, text, whether it was interrupted. */
type Line = readonly [Entry['who'], number, string, boolean];

/** Where the lines of a talk stay once it is over. */
export interface TalkStore {
  /** Whether they are there after a reload of the page. */
  readonly outlastsPage: boolean;
  /** What was said, the oldest first. */
  read(): Entry[];
  /** Keeps what was said instead of what was kept before. */
  write(entries: readonly Entry[]): void;
}

/** What was said with each avatar, for as long as this object lives: nothing of it goes into the browser's storage. */
export class TalkMemory {
  private readonly said = new Map<string, readonly Entry[]>();

  /** The lines of one avatar, named as in `KeptTalk`. */
  of(home: string, avatar: string): TalkStore {
    const key = JSON.stringify([home, avatar]);
    return {
      outlastsPage: false,
      read: () => [...(this.said.get(key) ?? [])],
      write: (entries) => this.said.set(key, entries.slice(-MOST_LINES)),
    };
  }
}

/** What was said with an avatar: in this tab alone until it is closed, so that a reload of the page does not lose it. */
export class KeptTalk implements TalkStore {
  readonly outlastsPage = true;
  private readonly key: string;
  private readonly avatar: string;

  /**
   * @param home address of the avatar's server
   * @param avatar tells it and its persona from others that the server may have had
   */
  constructor(home: string, avatar: string) {
    this.key = `talk-${home}`;
    this.avatar = avatar;
  }

  /** What was said, the oldest first; nothing where there is something else, which others may have written. */
  read(): Entry[] {
    return entriesIn(rememberedInTab(this.key), this.avatar);
  }

  /** Keeps the latest of what was said instead of what was kept before. */
  write(entries: readonly Entry[]): void {
    forgetInTab(this.key); // what is new may not fit beside it
    const lines = latest(entries.map(({ who, at, text, cut }): Line => [who, at.getTime(), text, cut]), MOST_UNITS - this.empty.length);
    if (lines.length > 0) rememberInTab(this.key, this.packed(lines));
  }

  private get empty(): string {
    return this.packed([]);
  }

  private packed(lines: readonly Line[]): string {
    return JSON.stringify({ avatar: this.avatar, lines });
  }
}

/**
 * Keeps what was said soon after it has changed, and at once when the page is hidden, which may be the last
 * that it is told of, or left.
 *
 * @returns is to be called after each change
 */
export function keepUp(kept: TalkStore, said: () => readonly Entry[], signal: AbortSignal): () => void {
  let due: ReturnType<typeof setTimeout> | undefined;
  const write = () => {
    if (due === undefined) return;
    clearTimeout(due);
    due = undefined;
    kept.write(said());
  };
  document.addEventListener('visibilitychange', write, { signal });
  atEnd(signal, write);
  return () => {
    due ??= setTimeout(write, SOON);
    if (signal.aborted) write();
  };
}

/** The last lines that take so many units of UTF-16 at most. */
function latest(lines: readonly Line[], units: number): readonly Line[] {
  let left = units;
  const tooMany = lines.findLastIndex((line) => (left -= JSON.stringify(line).length + 1) < 0); // a comma each
  return lines.slice(tooMany + 1).slice(-MOST_LINES);
}

function entriesIn(text: string | null, avatar: string): Entry[] {
  if (text === null || text.length > MOST_UNITS) return [];
  try {
    const kept = JSON.parse(text) as { avatar?: unknown; lines?: unknown } | null;
    if (kept?.avatar !== avatar || !Array.isArray(kept.lines) || kept.lines.length > MOST_LINES) return [];
    return kept.lines.every(isLine) ? kept.lines.map(([who, at, text, cut]) => ({ who, at: new Date(at), text, cut })) : [];
  } catch {
    return [];
  }
}

function isLine(line: unknown): line is Line {
  if (!Array.isArray(line) || line.length !== 4) return false;
  const [who, at, text, cut] = line as unknown[];
  return (who === 'you' || who === 'avatar') && isTime(at) && typeof text === 'string' && typeof cut === 'boolean';
}

function isTime(value: unknown): boolean {
  return typeof value === 'number' && !Number.isNaN(new Date(value).getTime());
}
