import { afterEach, beforeEach, expect, test, vi } from 'vitest';
import { ScriptedAudio } from '../../support/doubles/scripted-microphone.ts';
import { ScriptedSocket } from '../../support/doubles/scripted-socket.ts';
import { Conversation, type ConversationView } from '../../src/talk/conversation.ts';
import { english } from '../../src/words/text.ts';

let audio: ScriptedAudio;
let conversation: Conversation;
let told: [event: string, detail: unknown][];
let notices: string[];

beforeEach(() => {
  audio = new ScriptedAudio();
  vi.stubGlobal('window', globalThis);
  vi.stubGlobal('WebSocket', ScriptedSocket);
  for (const [name, value] of Object.entries(audio.globals)) vi.stubGlobal(name, value);
  [told, notices] = [[], []];
  const view: Partial<ConversationView> = { notice: (sentence) => notices.push(english(sentence)) };
  const others = { get: (known: object, name: string) => Reflect.get(known, name) ?? (() => {}) };
  conversation = new Conversation(() => 'ws://server/ws', new Proxy(view, others) as ConversationView, (event, detail) => told.push([event, detail]));
  conversation.start();
  ScriptedSocket.last.welcome();
});
afterEach(() => {
  conversation.dispose();
  vi.unstubAllGlobals();
});

test('gestures and called functions are told as they come', () => {
  ScriptedSocket.last.says({
    type: 'cues',
    utterance: 3,
    cues: [
      { number: 0, name: 'wave', mirror: true, begin: 0.5, stroke: 0.9, skip: 0 },
      { number: 1, name: 'nod', mirror: false, begin: 2, stroke: 2.2, skip: 0 },
    ],
    releases: [],
  });
  ScriptedSocket.last.says({ type: 'call', name: 'open_door', arguments: '{"side": "left", "wide": [1, 2]}' });
  expect(told).toEqual([
    ['gesture', { utterance: 3, name: 'wave', mirror: true, begin: 0.5, stroke: 0.9 }],
    ['gesture', { utterance: 3, name: 'nod', mirror: false, begin: 2, stroke: 2.2 }],
    ['tool-call', { name: 'open_door', arguments: { side: 'left', wide: [1, 2] } }],
  ]);
});

test('to open the microphone twice asks once, and to close a closed one does nothing', async () => {
  await conversation.setMicrophone(false);
  expect(audio.prompts).toHaveLength(0);
  const opening = conversation.setMicrophone(true);
  audio.prompts[0]!.allow();
  await vi.waitFor(() => expect(audio.nodes).toHaveLength(1));
  audio.sounds();
  await opening;
  await conversation.setMicrophone(true);
  expect([audio.prompts.length, audio.records]).toEqual([1, true]);
  await conversation.setMicrophone(false);
  expect(audio.records).toBe(false);
});

test.each([
  ['that gives none to it', { allowsFeature: () => false }, /^The site around this page does not give it the microphone/],
  ['of which the visitor gave none', { allowsFeature: () => true }, /^The microphone is blocked for this page/],
  ['in a browser that does not tell', undefined, /^The microphone is blocked for this page/],
])('a refused microphone in a page %s', async (_, featurePolicy, sentence) => {
  Object.assign(audio.page, { featurePolicy });
  const opening = conversation.setMicrophone(true);
  audio.prompts[0]!.deny('NotAllowedError');
  await opening;
  expect(notices).toEqual([expect.stringMatching(sentence)]);
});
