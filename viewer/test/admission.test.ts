import { afterEach, beforeEach, describe, expect, test, vi } from 'vitest';
import { admit, byKey, fromSite } from '../src/admission.ts';
import { Server } from '../src/server.ts';
import { Speaking } from '../src/talk/events.ts';
import { say } from '../src/words/text.ts';

const NOW = 1_000_000; // s

describe('a token', () => {
  let given: string[];
  let ending: AbortController;
  beforeEach(() => {
    ending = new AbortController();
    vi.useFakeTimers({ now: 1000 * NOW });
    vi.stubGlobal('fetch', async () => new Response(given.shift(), { status: 200 }));
  });
  afterEach(() => {
    vi.useRealTimers();
    vi.unstubAllGlobals();
  });

  test('is in every address, as the page of the server had it', () => {
    const server = new Server(new URL('https://avatar.example/anna/?token=a.b.c'));
    expect(server.file('body/0.bin')).toBe('https://avatar.example/anna/bundle/body/0.bin?token=a.b.c');
    expect(server.socket()).toBe('wss://avatar.example/anna/ws?token=a.b.c');
    expect(new Server(new URL('http://localhost:8765/#top')).socket()).toBe('ws://localhost:8765/ws');
  });

  test('is replaced before it expires, as text or JSON, until the talk ends', async () => {
    const server = new Server(new URL('https://avatar.example/'));
    given = [`${NOW + 600}.x.y\n`, '', JSON.stringify({ token: `${NOW + 1200}.x.y` }), 'never'];
    await admit(server, fromSite('https://site.example/token'), say('error.token'), ending.signal);
    expect(server.token).toBe(`${NOW + 600}.x.y`);
    await vi.advanceTimersByTimeAsync(479_000);
    expect(server.token).toBe(`${NOW + 600}.x.y`);
    await vi.advanceTimersByTimeAsync(12_000); // the first try to renew it fails
    expect(server.token).toBe(`${NOW + 1200}.x.y`);
    ending.abort();
    await vi.advanceTimersByTimeAsync(3_600_000);
    expect(given).toEqual(['never']);
  });

  test('that does not come is one sentence', async () => {
    given = [''];
    const server = new Server(new URL('https://avatar.example/'));
    const none = admit(server, fromSite('https://site.example/token'), say('error.token'), new AbortController().signal);
    await expect(none).rejects.toThrow(/could not get a token/);
  });

  test('is had for the key, which stands in no address', async () => {
    const asked: [string, RequestInit][] = [];
    vi.stubGlobal('fetch', async (url: string, options: RequestInit) => {
      asked.push([url, options]);
      return new Response(JSON.stringify({ token: `${NOW + 600}.x.y` }), { status: asked.length > 1 ? 401 : 200 });
    });
    const server = new Server(new URL('https://avatar.example/anna/#key=a b'));
    await admit(server, byKey(server, 'a b'), say('error.key'), ending.signal);
    expect(server.socket()).toBe(`wss://avatar.example/anna/ws?token=${NOW + 600}.x.y`);
    expect(asked).toEqual([['https://avatar.example/anna/token', expect.objectContaining({ method: 'POST', headers: { Authorization: 'Bearer a b' } })]]);
    await expect(admit(server, byKey(server, 'wrong'), say('error.key'), ending.signal)).rejects.toThrow(/key is wrong/);
  });
});

test('whoever begins to speak ends once, however that comes', () => {
  const told: unknown[] = [];
  const speaking = new Speaking((name, detail) => told.push([name, detail]));
  speaking.start(0);
  speaking.finish(0);
  speaking.stop(0);
  speaking.start(1);
  speaking.start(2);
  speaking.stop(1);
  speaking.stop();
  expect(told).toEqual([
    ['speak-start', { utterance: 0 }],
    ['speak-end', { utterance: 0, interrupted: false }],
    ['speak-start', { utterance: 1 }],
    ['speak-start', { utterance: 2 }],
    ['speak-end', { utterance: 1, interrupted: true }],
    ['speak-end', { utterance: 2, interrupted: true }],
  ]);
});
