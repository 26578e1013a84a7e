const words = new Intl.Segmenter(undefined, { granularity: 'word' });

/**
 * Breaks a text, in single spaces, into lines, in languages with and without spaces. A word that is too wide for a line
 * has one of its own.
 *
 * @param most widest line
 * @param width of a text, in the same unit
 */
export function linesOf(text: string, most: number, width: (text: string) => number): string[] {
  const lines: string[] = [];
  let line = '';
  for (const { segment, isWordLike } of words.segment(text)) {
    const ends = !isWordLike && !/\s$/.test(line); // a mark stays at its word
    if (line && !ends && width((line + segment).trimEnd()) > most) {
      lines.push(line.trimEnd());
      line = segment.trimStart();
    } else line += segment;
  }
  return line.trim() ? [...lines, line.trimEnd()] : lines;
}
