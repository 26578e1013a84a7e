import { afterEach, beforeEach, describe, expect, test, vi } from 'vitest';
import { Conversation, type ConversationView } from '../../src/talk/conversation.ts';
import { ScriptedAudio, STEPS } from '../../support/doubles/scripted-microphone.ts';
import { ScriptedSocket } from '../../support/doubles/scripted-socket.ts';
import { english } from '../../src/words/text.ts';

const OFF = 'The microphone is off now: turn it on to speak.';

let audio: ScriptedAudio;
let shown: string[]; // of the microphone
let notices: string[];
let talking: boolean;
let lines: string[];
let conversation: Conversation;

beforeEach(() => {
  vi.useFakeTimers({ now: 0, toFake: ['setTimeout', 'clearTimeout', 'setInterval', 'clearInterval', 'performance'] });
  audio = new ScriptedAudio();
  vi.stubGlobal('window', globalThis);
  vi.stubGlobal('WebSocket', ScriptedSocket);
  for (const [name, value] of Object.entries(audio.globals)) vi.stubGlobal(name, value);
  [shown, notices, talking, lines] = [[], [], false, []];
  const view: Partial<ConversationView> = {
    microphone: (state) => shown.push(state),
    talking: (held) => (talking = held),
    notice: (sentence) => notices.push(english(sentence)),
    line: (line) => lines.push(line),
  };
  const others = { get: (known: object, name: string) => Reflect.get(known, name) ?? (() => {}) };
  conversation = new Conversation(() => 'ws://server/ws', new Proxy(view, others) as ConversationView);
  conversation.start();
  ScriptedSocket.last.welcome();
});
afterEach(() => {
  vi.useRealTimers();
  vi.unstubAllGlobals();
});

/** Lets pass what has been promised, and then time. */
const pass = (milliseconds = 0) => vi.advanceTimersByTimeAsync(milliseconds);

async function open(): Promise<void> {
  void conversation.toggleMicrophone();
  audio.prompts.at(-1)!.allow();
  await pass();
  audio.sounds();
  await pass();
}

/** The microphone sounds for a while, over a network that carries it or does not. */
async function sound(milliseconds: number, carried = true): Promise<void> {
  for (let at = 0; at < milliseconds; at += 32) {
    audio.sounds();
    await pass(32);
    if (carried) ScriptedSocket.last.says({ type: 'ack', frames: sent() });
  }
}

const sent = () => ScriptedSocket.last.of('audio').length;

test('it opens with its first sound, and what it hears is sent', async () => {
  void conversation.toggleMicrophone();
  await pass();
  expect(shown).toEqual(['opening']);
  audio.prompts[0]!.allow();
  await pass(1000);
  expect(shown).toEqual(['opening']); // nothing has come from it
  audio.sounds();
  await pass();
  expect(shown).toEqual(['opening', 'open']);
  await sound(320);
  expect(ScriptedSocket.last.of('audio').map(({ sample }) => sample)).toEqual([0, 1, 2, 3, 4, 5, 6, 7, 8, 9].map((i) => 512 * i));
  await conversation.toggleMicrophone();
  expect(shown.at(-1)).toBe('closed');
  expect([audio.records, audio.running]).toEqual([false, 0]);
  expect(notices).toEqual([]);
});

describe.each(STEPS)('when it fails at: %s', (step) => {
  test.each(['toggle', 'button'])('nothing stays open, the page says so, and the next try may succeed (%s)', async (way) => {
    audio.fault = step;
    if (way === 'toggle') void conversation.toggleMicrophone();
    else void conversation.press();
    await pass();
    if (step === 'permission') audio.prompts[0]!.deny('NotAllowedError');
    else audio.prompts[0]!.allow();
    await pass();
    audio.sounds();
    await pass(10_000);
    expect([audio.records, audio.running]).toEqual([false, 0]);
    expect(notices).toEqual([expect.stringMatching(/^[A-Z].*type instead\.$/)]);
    const closed = step === 'permission' ? ['blocked'] : way === 'toggle' ? ['closed'] : [];
    expect(shown).toEqual([...(way === 'toggle' ? ['opening'] : []), ...closed]);
    expect(talking).toBe(false);
    conversation.release();
    expect([...ScriptedSocket.last.of('talk'), ...ScriptedSocket.last.of('audio')]).toEqual([]);

    audio.fault = null;
    await open();
    expect(shown.at(-1)).toBe('open');
    expect(audio.records).toBe(true);
    await sound(320);
    expect(sent()).toBe(10);
  });
});

test.each([
  ['NotAllowedError', 'The microphone is blocked for this page: allow it in the address bar, or type instead.'],
  ['NotFoundError', 'No microphone was found; plug one in, or type instead.'],
  ['NotReadableError', 'Another program holds the microphone; close it there, or type instead.'],
  ['AbortError', 'The microphone could not be opened; you can type instead.'],
])('%s has a sentence', async (name, sentence) => {
  void conversation.toggleMicrophone();
  audio.prompts[0]!.deny(name);
  await pass();
  expect(notices).toEqual([sentence]);
  expect(shown.at(-1)).toBe(name === 'NotAllowedError' ? 'blocked' : 'closed');
});

test('a microphone that is blocked is shown so until it is allowed', async () => {
  const permit = (state: string) => {
    audio.permission.state = state;
    audio.permission.dispatchEvent(new Event('change'));
  };
  void conversation.toggleMicrophone();
  audio.prompts[0]!.deny('NotAllowedError');
  await pass(60_000); // its sentence has gone meanwhile
  expect(shown).toEqual(['opening', 'blocked']);
  permit('granted');
  expect(shown.at(-1)).toBe('closed');
  permit('denied');
  expect(shown.at(-1)).toBe('blocked');
  await open(); // some systems block it themselves, and tell nobody when they allow it
  expect(shown.at(-1)).toBe('open');
  await conversation.toggleMicrophone();
  expect(shown.at(-1)).toBe('closed');
});

test('the button to talk tells of a blocked microphone, too', async () => {
  void conversation.press();
  audio.prompts[0]!.deny('NotAllowedError');
  await pass();
  conversation.release();
  expect(shown.at(-1)).toBe('blocked');
});

test('clicks while the browser asks neither ask again nor leave a second stream', async () => {
  for (let click = 0; click < 3; click++) void conversation.toggleMicrophone();
  void conversation.press();
  conversation.release();
  await pass();
  expect(audio.prompts).toHaveLength(1);
  audio.prompts[0]!.allow();
  await pass();
  audio.sounds();
  await pass();
  expect(audio.streams).toHaveLength(1);
  expect(shown).toEqual(['opening', 'open']);
  await conversation.toggleMicrophone();
  expect([shown.at(-1), audio.records, audio.running]).toEqual(['closed', false, 0]);
});

test('a button that is let go while the browser asks leaves no microphone open', async () => {
  void conversation.press();
  conversation.release();
  audio.prompts[0]!.allow();
  await pass();
  audio.sounds();
  await pass();
  expect([talking, sent()]).toEqual([false, 0]);
  expect(audio.records).toBe(true); // the next words are not to wait for it
  await sound(20_000);
  expect([audio.records, audio.running, sent()]).toEqual([false, 0, 0]);
});

test.each([
  [800, true, 'let go'],
  [800, false, 'held on'],
  [100, true, 'let go soon'],
])('words of %i ms before the microphone is open are lost, and the page says so (let go: %s)', async (milliseconds, letGo, how) => {
  void conversation.press();
  await pass(milliseconds);
  expect(conversation.hearsButton).toBe(false); // nothing shows that somebody is heard
  if (letGo) conversation.release();
  audio.prompts[0]!.allow();
  await pass();
  audio.sounds();
  await pass();
  expect(conversation.hearsButton).toBe(!letGo);
  expect(notices).toEqual(how === 'let go soon' ? [] : ['The microphone has only just opened: please say it again.']);
  conversation.release();
  await conversation.press(); // it is open still
  expect([conversation.hearsButton, notices.length]).toEqual([true, how === 'let go soon' ? 0 : 1]);
  conversation.release();
});

test('turning the microphone off leaves the button to talk what it needs', async () => {
  await open();
  await conversation.press();
  await conversation.toggleMicrophone();
  expect([shown.at(-1), talking, audio.records]).toEqual(['closed', true, true]);
  await sound(320);
  expect(sent()).toBe(10);
  conversation.release();
  await sound(20_000);
  expect([talking, audio.records, sent()]).toEqual([false, false, 10]);
});

test.each([
  ['is pulled out', () => audio.streams[0]!.tracks[0]!.vanish(), 0],
  ['has a worklet that breaks', () => audio.nodes[0]!.onprocessorerror!(), 0],
  ['gives no sound any more', () => (audio.fault = 'sound'), 5500],
])('a microphone that %s is shown as closed', async (_, happens, within) => {
  await open();
  await sound(5000);
  expect([shown.at(-1), notices]).toEqual(['open', []]);
  happens();
  await sound(within);
  expect([shown.at(-1), audio.records, audio.running]).toEqual(['closed', false, 0]);
  expect(notices).toEqual([expect.stringMatching(/^The microphone .*type instead\.$/)]);
  audio.fault = null;
  await open();
  expect([shown.at(-1), audio.records]).toEqual(['open', true]);
});

test.each(['suspended', 'interrupted'])('a context that is %s is asked to go on, and may', async (state) => {
  await open();
  const context = audio.contexts.at(-1)!;
  const before = context.resumed;
  context.state = state;
  context.onstatechange!();
  expect(context.resumed).toBe(before + 1);
  await pass(1500); // without a sound
  context.state = 'running';
  context.onstatechange!();
  await sound(10_000);
  expect([shown.at(-1), notices]).toEqual(['open', []]);
});

describe('when the session ends', () => {
  const end = () => ScriptedSocket.last.hangUp('Nothing was said for 10 min.', 1000, true);

  test('an open microphone is closed, and none opens before the next session', async () => {
    await open();
    void conversation.press();
    await pass();
    expect(talking).toBe(true);
    end();
    expect([shown.at(-1), talking, audio.records, audio.running]).toEqual(['closed', false, false, 0]);
    void conversation.toggleMicrophone();
    void conversation.press();
    await pass();
    expect(audio.prompts).toHaveLength(1);
    conversation.start();
    ScriptedSocket.last.welcome();
    await open();
    expect([shown.at(-1), audio.records]).toEqual(['open', true]);
  });

  test('one that the browser still asks about does not open', async () => {
    void conversation.toggleMicrophone();
    end();
    await pass();
    expect(shown.at(-1)).toBe('closed');
    conversation.start();
    ScriptedSocket.last.welcome();
    void conversation.toggleMicrophone(); // asks anew, while the first question stands
    audio.prompts[0]!.allow();
    await pass();
    expect([shown.at(-1), audio.records]).toEqual(['opening', false]);
    audio.prompts[1]!.allow();
    await pass();
    audio.sounds();
    await pass();
    expect([shown.at(-1), audio.streams.map(({ tracks }) => tracks[0]!.readyState)]).toEqual(['open', ['ended', 'live']]);
    expect(notices).toEqual([OFF]);
  });

  test('another one that takes its place finds the microphone closed', async () => {
    await open();
    ScriptedSocket.last.drop();
    await sound(320, false);
    expect(audio.records).toBe(true); // it may be resumed
    ScriptedSocket.last.welcome({ session: 'second' });
    expect([shown.at(-1), audio.records]).toEqual(['closed', false]);
    expect(notices).toEqual(['The conversation of before is over; a new one begins.', OFF]);
  });
});

test('a button that is let go while the line is down is not held when it is up again', async () => {
  await open();
  await conversation.press();
  ScriptedSocket.last.drop();
  conversation.release();
  await pass(300);
  ScriptedSocket.last.welcome({ resumed: true });
  expect(ScriptedSocket.last.of('talk')).toMatchObject([{ pressed: false }]);
});

test('a release that was lost with the line is told again', async () => {
  await open();
  await conversation.press();
  await sound(3000, false); // nothing is acknowledged any more
  conversation.release();
  ScriptedSocket.last.drop();
  await pass(300);
  ScriptedSocket.last.welcome({ resumed: true });
  expect(ScriptedSocket.last.of('talk')).toMatchObject([{ pressed: false }]);
});

test('the page says when the network loses what is said', async () => {
  await open();
  await sound(3000, false);
  expect([lines.at(-1), notices]).toEqual(['slow', []]);
  ScriptedSocket.last.says({ type: 'ack', frames: 1 });
  expect(lines.at(-1)).toBe('up');
});
