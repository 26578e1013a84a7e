import { afterEach, expect, test, vi } from 'vitest';
import { Server } from '../../src/server.ts';
import { Recordings, Refusal } from '../../src/studio/recordings.ts';
import { LONGEST } from '../../src/words/calm.ts';

const recordings = new Recordings(new Server(new URL('http://127.0.0.1/')));

function answers(text: string, status = 200): void {
  vi.stubGlobal('fetch', () => Promise.resolve(new Response(text, { status })));
}

afterEach(() => vi.unstubAllGlobals());

test('what stands in a folder that somebody brought is laid out at once', async () => {
  const advice = ['\u{1f3fb}'.repeat(15_000), 'x'.repeat(60_000)]; // of the first one laying out takes half a minute
  answers(JSON.stringify({ name: 'Ada', making: { advice } }));
  const { name, making } = await recordings.status('Ada');
  expect(name).toBe('Ada');
  const [tones, letters] = making!.advice as string[];
  expect(tones!.length).toBeLessThan(40);
  expect(letters!.length).toBeLessThan(1.1 * LONGEST);
});

test('a refusal is told, whatever its body is', async () => {
  answers('{"error": "no room"}', 507);
  await expect(recordings.status('Ada')).rejects.toMatchObject({ status: 507, message: 'no room' });
  answers('Internal Server Error', 500);
  const refused: unknown = await recordings.status('Ada').catch((error: unknown) => error);
  expect(refused).toBeInstanceOf(Refusal);
  expect(refused).toMatchObject({ status: 500 });
});
