import { PageError } from './errors.ts';
import { atEnd } from './lifetime.ts';
import type { Server } from './server.ts';
import { say, type Sentence } from './words/text.ts';

const SHARE = 0.8; // of its time after which a token is replaced
const SHORTEST = 10_000; // ms: who has the wrong key may not ask more often
const LONGEST = 2 ** 31 - 1; // ms, of a timer

/** Fetches what holds a token: the text of it, or JSON that has it as `token`; empty if there is none. */
export type Fetching = (signal: AbortSignal) => Promise<string>;

/**
 * Gets a token, and a new one before it expires.
 *
 * @param missing what is said if there is none at first
 * @throws PageError if so
 */
export async function admit(server: Server, fetching: Fetching, missing: Sentence, signal: AbortSignal): Promise<void> {
  const text = await fetching(signal).catch(() => '');
  signal.throwIfAborted();
  const token = readToken(text);
  if (!token) throw new PageError(missing);
  server.token = token;
  const expires = 1000 * Number(token.split('.')[0]);
  renewLater(server, fetching, SHARE * (expires - Date.now()) || 0, signal);
}

/** Tokens from the backend of the site around the avatar. */
export function fromSite(url: string): Fetching {
  return (signal) => textOf(fetch(url, { signal, cache: 'no-store' }));
}

/** Tokens from the server itself, for its key. */
export function byKey(server: Server, key: string): Fetching {
  const headers = { Authorization: `Bearer ${key}` };
  return (signal) => textOf(fetch(server.tokens(), { method: 'POST', headers, signal, cache: 'no-store' }));
}

function renewLater(server: Server, fetching: Fetching, wait: number, signal: AbortSignal): void {
  const renew = () => admit(server, fetching, say('error.token'), signal).catch(() => renewLater(server, fetching, 0, signal));
  const timer = setTimeout(renew, Math.min(LONGEST, Math.max(SHORTEST, wait)));
  atEnd(signal, () => clearTimeout(timer));
}

async function textOf(asked: Promise<Response>): Promise<string> {
  const response = await asked;
  return response.ok ? response.text() : '';
}

function readToken(text: string): string {
  try {
    const { token } = JSON.parse(text) as { token?: unknown };
    return typeof token === 'string' ? token : '';
  } catch {
    return text.trim();
  }
}
