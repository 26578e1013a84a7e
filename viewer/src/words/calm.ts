/** Most UTF-16 units of a text that is laid out. */
export const LONGEST = 4000;
const BRIEF = 300;

/** What a stranger's JSON says, its texts made calm. */
export function parseCalmly(text: string): unknown {
  return JSON.parse(text, (_, value: unknown) => (typeof value === 'string' ? calm(value) : value));
}

/**
 * A text that is laid out at once: that takes the square of its length, of what belongs to one of its letters, and of words without a place to break.
 */
export function calm(text: string): string {
  const few = text.replace(CONTINUED, '$1');
  return (few.length > LONGEST ? `${few.slice(0, LONGEST)}…` : few).replace(LONG_WORD, '$&\u200b');
}

/** A text within an error, which needs no more than its beginning. */
export function brief(text: string): string {
  return calm(text.length > BRIEF ? `${text.slice(0, BRIEF)}…` : text);
}

// marks, joiners, tags and skin tones: what does not begin a letter of its own; as many as writing knows, and more of them
const MORE = String.raw`[\p{M}\p{Cf}\p{Emoji_Modifier}\u0e33\u0eb3\uff9e\uff9f]`;
const CONTINUED = new RegExp(`(${MORE}{16})${MORE}+`, 'gu');
// a letter of scripts that put blanks between words; others break where they like, but not before what belongs to a letter
const LETTER = String.raw`(?!${MORE})[^\s\u200b\p{sc=Han}\p{sc=Hira}\p{sc=Kana}\p{sc=Thai}\p{sc=Laoo}\p{sc=Khmr}\p{sc=Mymr}\u3000-\u303f\uff00-\uffef]`;
const LONG_WORD = new RegExp(`(?:(?!\\u200b)${MORE}|${LETTER}){100,116}?(?=${LETTER})`, 'gu');
