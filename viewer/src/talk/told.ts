import type { ErrorMessage, Notice } from '../protocol.ts';
import { isKey, say, type Sentence } from '../words/text.ts';

/** A sentence of the server; where the page does not know its code, the English one as it is. */
export function told(message: ErrorMessage | Notice): Sentence {
  const english = 'message' in message ? message.message : message.text;
  const key = `server.${message.code}`;
  return isKey(key) ? { ...say(key, 'values' in message ? message.values : {}), english } : english;
}
