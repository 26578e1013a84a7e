import { afterEach, beforeEach, describe, expect, test, vi } from 'vitest';
import { Conversation, type ConversationView } from '../../src/talk/conversation.ts';
import { ScriptedAudio } from '../../support/doubles/scripted-microphone.ts';
import { ScriptedSocket } from '../../support/doubles/scripted-socket.ts';
import { english } from '../../src/words/text.ts';

const AGAIN = 'The microphone is on again.';

let audio: ScriptedAudio;
let shown: string[]; // of the microphone
let notices: string[];
let silenced: boolean[];
let lines: string[];
let conversation: Conversation;

beforeEach(async () => {
  vi.useFakeTimers({ now: 0, toFake: ['setTimeout', 'clearTimeout', 'setInterval', 'clearInterval', 'performance'] });
  audio = new ScriptedAudio();
  vi.stubGlobal('window', globalThis);
  vi.stubGlobal('WebSocket', ScriptedSocket);
  for (const [name, value] of Object.entries(audio.globals)) vi.stubGlobal(name, value);
  [shown, notices, silenced, lines] = [[], [], [], []];
  const view: Partial<ConversationView> = {
    microphone: (state) => shown.push(state),
    notice: (sentence) => notices.push(english(sentence)),
    silenced: (silent) => silenced.push(silent),
    line: (line) => lines.push(line),
  };
  const others = { get: (known: object, name: string) => Reflect.get(known, name) ?? (() => {}) };
  conversation = new Conversation(() => 'ws://server/ws', new Proxy(view, others) as ConversationView);
  conversation.start();
  ScriptedSocket.last.welcome();
  await pass();
});
afterEach(() => {
  conversation.dispose();
  vi.useRealTimers();
  vi.unstubAllGlobals();
});

/** Lets pass what has been promised, and then time. */
const pass = (milliseconds = 0) => vi.advanceTimersByTimeAsync(milliseconds);

/** The browser allows what it was last asked, and the microphone sounds. */
async function allow(): Promise<void> {
  audio.prompts.at(-1)!.allow();
  await pass();
  audio.sounds();
  await pass();
}

async function open(): Promise<void> {
  void conversation.toggleMicrophone();
  await pass();
  await allow();
}

const unplug = () => audio.streams.at(-1)!.tracks[0]!.vanish();

describe('a microphone that was lost', () => {
  test('opens again by itself, and says so', async () => {
    await open();
    unplug();
    expect([shown.at(-1), audio.records]).toEqual(['closed', false]);
    await pass(1000);
    expect([shown.at(-1), audio.prompts.length]).toEqual(['opening', 2]);
    await allow();
    expect([shown.at(-1), audio.records, audio.running]).toEqual(['open', true, 1]);
    expect(notices).toEqual(['The microphone was disconnected; you can type instead.', AGAIN]);
    audio.sounds();
    expect(ScriptedSocket.last.of('audio')).toMatchObject([{ sample: 0 }]);
  });

  test('is waited for without asking all the time, until a device is there', async () => {
    await open();
    unplug();
    await pass(1000);
    audio.prompts.at(-1)!.deny('NotFoundError');
    await pass(60_000);
    expect([shown.at(-1), audio.prompts.length]).toEqual(['closed', 2]);
    audio.plug('headset');
    await pass();
    await allow();
    expect([shown.at(-1), notices]).toEqual(['open', ['The microphone was disconnected; you can type instead.', AGAIN]]);
  });

  test('comes back with the page after a telephone call', async () => {
    await open();
    audio.look(false);
    unplug();
    await pass(1000);
    audio.prompts.at(-1)!.deny('NotReadableError');
    await pass(90_000); // the call
    audio.look(true);
    await pass();
    await allow();
    expect([shown.at(-1), notices.at(-1)]).toEqual(['open', AGAIN]);
  });

  test.each([
    ['after so long that nobody expects it', () => pass(301_000)],
    ['when the session has ended', async () => ScriptedSocket.last.hangUp('Nothing was said.', 1000, true)],
    ['when the visitor has turned it on and off', async () => {
      await open();
      await conversation.toggleMicrophone();
    }],
  ])('does not open %s', async (_, happens) => {
    await open();
    unplug();
    await pass(1000);
    audio.prompts.at(-1)!.deny('NotFoundError');
    await pass();
    await happens();
    const asked = audio.prompts.length;
    audio.plug('headset');
    await pass(5000);
    expect([shown.at(-1), audio.prompts.length, audio.records]).toEqual(['closed', asked, false]);
  });

  test('does not open if only the button to talk had opened it', async () => {
    void conversation.press();
    await pass();
    await allow();
    unplug();
    await pass(5000);
    expect([audio.prompts.length, audio.records]).toEqual([1, false]);
  });
});

describe('a server that is gone', () => {
  const OFF = 'The microphone is off now: turn it on to speak.';

  test('is told of as long as it is, and typed questions are not taken', async () => {
    ScriptedSocket.last.drop();
    expect([lines.at(-1), conversation.ask('Are you there?')]).toEqual(['lost', false]);
    await pass(300);
    ScriptedSocket.last.welcome({ resumed: true });
    expect([lines.at(-1), conversation.ask('Are you there?')]).toEqual(['up', true]);
  });

  test.each([
    ['that knows nobody any more', async () => void (await pass(300))],
    ['after so long that the session is over', async () => {
      for (let passed = 0; passed < 45_000; passed += 5000) {
        if (!ScriptedSocket.last.closed) ScriptedSocket.last.drop();
        await pass(5000);
      }
    }],
  ])('and comes back %s finds the microphone off, and the page says so', async (_, happens) => {
    await open();
    ScriptedSocket.last.drop();
    await happens();
    while (ScriptedSocket.last.closed) await pass(1000);
    ScriptedSocket.last.welcome({ session: 'second' });
    expect([shown.at(-1), notices.at(-1), lines.at(-1)]).toEqual(['closed', OFF, 'up']);
    ScriptedSocket.last.drop();
    await pass(300);
    ScriptedSocket.last.welcome({ session: 'third' });
    expect(notices.filter((notice) => notice === OFF)).toHaveLength(1); // it was off already
  });
});

describe('who turns the microphone off', () => {
  const acknowledged = () => ScriptedSocket.last.says({ type: 'ack', frames: ScriptedSocket.last.of('audio').length });
  const after = async (milliseconds: number) => {
    for (let passed = 0; passed < milliseconds; passed += 100) {
      acknowledged();
      await pass(100);
    }
    acknowledged();
  };

  test('has said what was said: a second of silence ends the turn', async () => {
    await open();
    for (const level of [10, 8000]) audio.sounds(new Int16Array(512).fill(level));
    acknowledged();
    const before = ScriptedSocket.last.of('audio').length;
    await conversation.toggleMicrophone();
    expect(audio.records).toBe(false);
    await after(2000);
    const silence = ScriptedSocket.last.of('audio').slice(before);
    expect(silence.map(({ sample }) => sample)).toEqual(Array.from({ length: 10 }, (_, i) => 1024 + 1600 * i));
  });

  test('and on again speaks on', async () => {
    await open();
    for (const level of [10, 8000]) audio.sounds(new Int16Array(512).fill(level));
    await conversation.toggleMicrophone();
    await after(300);
    await open();
    const before = ScriptedSocket.last.of('audio').length;
    await after(1000);
    expect(ScriptedSocket.last.of('audio')).toHaveLength(before);
  });

  test('and has said nothing, sends nothing more', async () => {
    await open();
    const before = ScriptedSocket.last.of('audio').length;
    await conversation.toggleMicrophone();
    await after(1000);
    expect(ScriptedSocket.last.of('audio')).toHaveLength(before);
  });
});

test('an open microphone follows the system to a headset, and stays where nothing has changed', async () => {
  await open();
  audio.plug('built in'); // another loudspeaker, perhaps
  await pass();
  expect(audio.prompts).toHaveLength(1);
  audio.plug('headset');
  await pass();
  await allow();
  expect(audio.streams.map(({ tracks }) => tracks[0]!.readyState)).toEqual(['ended', 'live']);
  expect([shown, notices]).toEqual([['opening', 'open', 'opening', 'open'], [AGAIN]]);
});

describe('sound that the system stops', () => {
  const change = (state: string) => {
    const context = audio.contexts[0]!;
    context.state = state;
    context.onstatechange!();
  };

  test('goes on by itself where the browser lets it', async () => {
    change('interrupted');
    expect(audio.contexts[0]!.resumed).toBe(1);
    change('running');
    await pass(5000);
    expect(silenced).toEqual([]);
  });

  test('is told of, and goes on with the next tap', async () => {
    change('suspended');
    await pass(700);
    expect(silenced).toEqual([true]);
    const { resumed } = audio.contexts[0]!;
    audio.page.dispatchEvent(new Event('pointerup'));
    expect(audio.contexts[0]!.resumed).toBe(resumed + 1);
    change('running');
    expect(silenced).toEqual([true, false]);
    audio.page.dispatchEvent(new Event('pointerup'));
    expect(audio.contexts[0]!.resumed).toBe(resumed + 1); // nothing to do any more
  });
});

describe('the screen', () => {
  const says = (state: string) => ScriptedSocket.last.says({ type: 'state', state });

  test('stays on while somebody talks, and no longer', async () => {
    await pass();
    expect(audio.wake).toEqual({ asked: 0, held: false });
    says('thinking');
    await pass();
    says('speaking');
    await pass();
    expect(audio.wake).toEqual({ asked: 1, held: true });
    says('idle');
    await pass();
    expect(audio.wake.held).toBe(false);
    await open();
    expect(audio.wake.held).toBe(true);
    await conversation.toggleMicrophone();
    await pass();
    expect(audio.wake.held).toBe(false);
  });

  test('is kept on again when the page is looked at again, and let go with the session', async () => {
    await open();
    audio.look(false);
    await pass();
    expect(audio.wake.held).toBe(false);
    audio.look(true);
    await pass();
    expect(audio.wake).toEqual({ asked: 2, held: true });
    ScriptedSocket.last.hangUp('Nothing was said for 10 min.', 1000, true);
    await pass();
    expect(audio.wake.held).toBe(false);
  });
});
