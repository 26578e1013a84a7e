import { PageError } from '../errors.ts';
import { atEnd } from '../lifetime.ts';
import type { Server } from '../server.ts';
import { say } from '../words/text.ts';

const SHARE = 0.8; // of its time after which a token is replaced
const SHORTEST = 5000; // ms
const LONGEST = 2 ** 31 - 1; // ms, of a timer

/**
 * Fetches a token from the site's own backend, and a new one before it expires.
 *
 * @param url answers with the token, or with JSON that has it as `token`
 * @throws PageError if there is none at first
 */
export async function admit(server: Server, url: string, signal: AbortSignal): Promise<void> {
  server.token = await fetchToken(url, signal);
  const expires = 1000 * Number(server.token.split('.')[0]);
  renewLater(server, url, SHARE * (expires - Date.now()) || 0, signal);
}

function renewLater(server: Server, url: string, wait: number, signal: AbortSignal): void {
  const renew = () => admit(server, url, signal).catch(() => renewLater(server, url, 0, signal));
  const timer = setTimeout(renew, Math.min(LONGEST, Math.max(SHORTEST, wait)));
  atEnd(signal, () => clearTimeout(timer));
}

async function fetchToken(url: string, signal: AbortSignal): Promise<string> {
  const text = await fetch(url, { signal, cache: 'no-store' })
    .then((response) => (response.ok ? response.text() : ''))
    .catch(() => '');
  signal.throwIfAborted();
  const token = readToken(text);
  if (!token) throw new PageError(say('error.token'));
  return token;
}

function readToken(text: string): string {
  try {
    const { token } = JSON.parse(text) as { token?: unknown };
    return typeof token === 'string' ? token : '';
  } catch {
    return text.trim();
  }
}
