/** An error whose message is one sentence that a visitor can read. */
export class PageError extends Error {
  override name = 'PageError';
}

/** The sentence to show for anything thrown. */
export function sentenceOf(error: unknown): string {
  if (error instanceof PageError) return error.message;
  const detail = error instanceof Error ? error.message : String(error);
  return `Something went wrong in this page: ${detail}.`;
}
