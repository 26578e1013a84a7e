/** Most UTF-16 units of a text that is laid out. */
export const LONGEST = 4000;
const BRIEF = 300;
const LONG = 100; // letters of a word without a place to break

/** What is never laid out, and means something else once a letter is put in. */
const VERBATIM = 'arguments';

/** What a stranger's JSON says, its texts made calm. */
export function parseCalmly(text: string): unknown {
  return JSON.parse(text, (key, value: unknown) => (typeof value === 'string' && key !== VERBATIM ? calm(value) : value));
}

/**
 * A text that is laid out at once: that takes the square of its length, of what belongs to one of its letters, and of words without a place to break.
 */
export function calm(text: string): string {
  const few = text.replace(CONTINUED, '$1');
  return (few.length > LONGEST ? `${few.slice(0, LONGEST)}…` : few).replace(WORD, (word) => (word.length > LONG ? broken(word) : word));
}

/** A long word with places to break. */
function broken(word: string): string {
  let [text, since] = ['', 0];
  for (const letter of word) {
    const breaks = since >= LONG && !BELONGING.test(letter);
    text += breaks ? `\u200b${letter}` : letter;
    since = breaks ? 1 : since + 1;
  }
  return text;
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
const WORD = new RegExp(`(?:(?!\\u200b)${MORE}|${LETTER})+`, 'gu'); // each letter is looked at once, however long words are
const BELONGING = new RegExp(MORE, 'u');
