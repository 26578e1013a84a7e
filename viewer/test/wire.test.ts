import { readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { expect, test } from 'vitest';
import { floatFromHalf, floatsFromHalves } from '../src/numbers.ts';
import { MAX_BINARY_FRAME, MAX_TEXT_FRAME, type SpeechMessage } from '../src/protocol.ts';
import { decode, encode } from '../src/talk/wire.ts';
import { runPython } from '../support/python.ts';
import { arrayBuffer } from '../support/references/head.ts';
import { scratchFolder } from '../support/scratch.ts';

test('frames of the server mean here what they meant there', () => {
  const folder = scratchFolder();
  runPython('references/wire_fixtures.py', 'encode', folder);
  const text = (name: string) => decode(readFileSync(join(folder, name), 'utf8'));

  const service = { name: 'offline', stand_in: true };
  expect(text('0.json')).toEqual({
    type: 'welcome',
    version: 1,
    session: 'session',
    resumed: false,
    services: { recognition: service, language: service, voice: { name: 'cloud', stand_in: false } },
    notices: [{ code: 'still-lips', text: 'No speech in this avatar, sagt sie – schade.' }],
    dictation: { language: 'de-DE', fallback: null },
    offers: [{ kind: 'voice', key: 'a', name: 'A', hindrance: 'install it.' }],
    remembers: true,
  });
  expect(text('1.json')).toEqual({ type: 'state', state: 'thinking' });
  const speech = decode(arrayBuffer(readFileSync(join(folder, '2.bin')))) as SpeechMessage;
  expect(speech).toMatchObject({ utterance: 3, index: 7, first_sample: 4800, first_expression: 5 });
  expect(speech.pcm).toEqual(Int16Array.from({ length: 2400 }, (_, i) => i - 1200));
  expect(speech.expressions).toMatchObject({ rows: 3, columns: 39 });
  expect(speech.expressions.values).toEqual(Float32Array.from({ length: 117 }, (_, i) => i / 64 - 1));
  expect(text('3.json')).toEqual({ type: 'end', utterance: 3, samples: 7200 });
});

test('frames of the page mean there what they mean here', () => {
  const folder = scratchFolder();
  const messages = [
    { type: 'hello', version: 1, session: null, last_index: -1, wishes: { voice: 'a' } },
    { type: 'audio', sample: 640, pcm: Int16Array.from({ length: 640 }, (_, i) => 100 * (i - 320)), playing: 3, position: 1.25 },
    { type: 'text', text: 'Wie spät ist es? 🙂' },
    { type: 'clock', utterance: 2, position: 0.5, body_time: 0 },
  ] as const;
  const files = messages.map((message, i) => {
    const frame = encode(message);
    const file = join(folder, `${i}.${typeof frame === 'string' ? 'json' : 'bin'}`);
    writeFileSync(file, typeof frame === 'string' ? frame : new Uint8Array(frame));
    return file;
  });
  const understood = JSON.parse(runPython('references/wire_fixtures.py', 'decode', ...files)) as object[];
  const expected = messages.map(({ type: _, ...fields }) =>
    'pcm' in fields ? { ...fields, pcm: [...fields.pcm] } : fields,
  );
  expect(understood).toEqual(expected);
});

test.each([
  [0x0000, 0],
  [0x8000, -0],
  [0x3c00, 1],
  [0xc000, -2],
  [0x3555, 0.333251953125],
  [0x0001, 2 ** -24],
  [0x03ff, 1023 * 2 ** -24],
  [0x0400, 2 ** -14],
  [0x7bff, 65504],
  [0x7c00, Infinity],
  [0xfc00, -Infinity],
  [0x7e00, NaN],
])('half float %i is %d', (bits, value) => expect(floatFromHalf(bits)).toBe(value));

test('a message of no known type is refused', () => {
  expect(() => decode('{"type": "hello"}')).toThrow(/unknown message hello/);
});

/** A binary frame with a head, and so many bytes of zeros behind it. */
function binaryFrame(header: object, body = 0): ArrayBuffer {
  const text = new TextEncoder().encode(JSON.stringify(header));
  const frame = new Uint8Array(4 + text.length + body);
  new DataView(frame.buffer).setUint32(0, text.length, true);
  frame.set(text, 4);
  return frame.buffer;
}

/** A frame of speech with sizes that may not be those of its sound (2,) and expressions (1, 3). */
function speechFrame(pcm: unknown, expressions: unknown, padding = 0): ArrayBuffer {
  return binaryFrame({ type: 'speech', utterance: 1, index: 0, first_sample: 0, first_expression: 0, pcm, expressions }, 2 * 2 + 2 * 3 + padding);
}

test('a frame of speech must hold what its sizes say', () => {
  expect((decode(speechFrame([2], [1, 3])) as SpeechMessage).expressions).toMatchObject({ rows: 1, columns: 3 });
  expect((decode(speechFrame([5], [70, 0])) as SpeechMessage).expressions).toMatchObject({ rows: 0, columns: 0 });
  expect((decode(speechFrame([5], [65_536, 0])) as SpeechMessage).expressions).toMatchObject({ rows: 0, columns: 0 });
  const header = { type: 'speech', utterance: 1, index: 0, first_sample: 0, first_expression: 0, pcm: [0], expressions: [65, 1] };
  expect(() => decode(binaryFrame(header, 130))).toThrow(/65 moments/); // a view of each would be kept, 50 times as large
  const odd: [unknown, unknown, number?][] = [
    [[2], [200_000_000, 53]],
    [[5], [200_000_000, 0]],
    [[2], [1, 2]],
    [[2], [1, 3], 2],
    [[2], [3]],
    [[2, 1], [1, 3]],
    [[-2], [1, 7]],
    [[0.5], [1, 3]],
    [null, [1, 3]],
    [[2], '13'],
    [[2], { length: 2, 0: 1, 1: 3 }],
    [[2], ['1', 3]],
  ];
  for (const [pcm, expressions, padding] of odd) {
    expect(() => decode(speechFrame(pcm, expressions, padding)), JSON.stringify([pcm, expressions])).toThrow(/odd shape|bytes instead of/);
  }
});

test('a message that is longer than any may be is not even parsed', () => {
  const wide = speechFrame([2], [1, 3], MAX_BINARY_FRAME - speechFrame([2], [1, 3]).byteLength + 1);
  expect(() => decode(wide)).toThrow(/more than 65536 bytes/);
  expect(() => decode(wide.slice(0, -1))).toThrow(/bytes instead of/);
  expect(() => decode(`{"type": "state", "state": "${'a'.repeat(MAX_TEXT_FRAME)}"}`)).toThrow(/more than 16384 bytes/);
});

test('each message travels in its kind of frame, and a head is no longer than a text', () => {
  expect(() => decode(binaryFrame({ type: 'answer', utterance: 5, first_sample: 0, text: 'a' }))).toThrow(/answer is no message of a binary frame/);
  expect(() => decode('{"type": "speech", "pcm": [0], "expressions": [0, 0]}')).toThrow(/speech is no message of a text frame/);
  const speech = { type: 'speech', utterance: 1, index: 0, first_sample: 0, first_expression: 0, pcm: [0], expressions: [0, 0] };
  expect(decode(binaryFrame(speech))).toMatchObject({ type: 'speech' });
  expect(() => decode(binaryFrame({ ...speech, more: 'a'.repeat(MAX_TEXT_FRAME) }))).toThrow(/more than 16384 bytes/);
});

test('many half floats are the same as each alone', () => {
  const words = Uint16Array.from({ length: 1 << 16 }, (_, word) => word);
  expect(floatsFromHalves(words)).toEqual(Float32Array.from(words, floatFromHalf));
});
