/** Most UTF-16 units of a text that is laid out. */
export const LONGEST = 8000;
const BRIEF = 300;

/** What a stranger's JSON says, its texts made calm. */
export function parseCalmly(text: string): unknown {
  return JSON.parse(text, (_, value: unknown) => (typeof value === 'string' ? calm(value) : value));
}

/** A text that is laid out at once: that takes the square of its length, and of what belongs to one of its letters. */
export function calm(text: string): string {
  const few = text.replace(CONTINUED, '$1');
  return few.length > LONGEST ? `${few.slice(0, LONGEST)}…` : few;
}

/** A text within an error, which needs no more than its beginning. */
export function brief(text: string): string {
  const few = calm(text.slice(0, 2 * BRIEF));
  return few.length > BRIEF ? `${few.slice(0, BRIEF)}…` : few;
}

// marks, joiners, tags and skin tones: what does not begin a letter of its own; as many as writing knows, and more of them
const CONTINUED = /([\p{M}\p{Cf}\p{Emoji_Modifier}\u0e33\u0eb3\uff9e\uff9f]{16})[\p{M}\p{Cf}\p{Emoji_Modifier}\u0e33\u0eb3\uff9e\uff9f]+/gu;
