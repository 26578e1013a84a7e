import { afterEach, beforeEach, describe, expect, test, vi } from 'vitest';
import { Connection, type ConnectionEvents, type Ending } from '../../src/talk/connection.ts';
import { say } from '../../src/words/text.ts';
import { ScriptedSocket } from '../../support/doubles/scripted-socket.ts';

const FULL = 'all places are taken, and so are those in the queue: try again in a minute.';

beforeEach(() => {
  vi.useFakeTimers({ now: 0, toFake: ['setTimeout', 'clearTimeout', 'performance'] });
  vi.stubGlobal('WebSocket', ScriptedSocket);
  ScriptedSocket.all = [];
});
afterEach(() => {
  vi.restoreAllMocks();
  vi.useRealTimers();
  vi.unstubAllGlobals();
});

function connect(message: ConnectionEvents['message'] = () => {}) {
  const endings: Ending[] = [];
  const told: string[] = [];
  const events: ConnectionEvents = {
    message,
    welcome: ({ resumed }, replaced) => told.push(`welcome, resumed ${resumed}, replaced ${replaced}`),
    lost: () => told.push('lost'),
    regained: () => told.push('regained'),
    queued: ({ position, seconds }) => told.push(`place ${position}, ${seconds} s`),
    stalled: () => {},
    ended: (ending) => endings.push(ending),
  };
  const connection = new Connection(() => 'ws://server/ws', events);
  connection.open();
  return { connection, endings, told };
}

/** How long it takes until the next try, ms; null if there is none within ten minutes. */
function nextTry(): number | null {
  const [began, tries] = [performance.now(), ScriptedSocket.all.length];
  while (ScriptedSocket.all.length === tries) {
    if (performance.now() - began > 600_000) return null;
    vi.advanceTimersByTime(100);
  }
  return performance.now() - began;
}

test('a server whose queue is full is asked again, less and less often, until there is a place', () => {
  const { connection, endings, told } = connect();
  for (const wait of [5000, 10_000, 20_000, 40_000, 60_000, 60_000]) {
    ScriptedSocket.last.hangUp(FULL, 1013, true);
    expect(endings.at(-1)).toEqual({ sentence: FULL, again: true, wait });
    expect(nextTry()).toBe(wait);
  }
  ScriptedSocket.last.welcome();
  expect(told).toEqual(['welcome, resumed false, replaced false']);
  expect(connection.send({ type: 'text', text: 'At last!' })).toBe(true);
  ScriptedSocket.last.hangUp(FULL, 1013, true); // the waits begin anew
  expect(endings.at(-1)!.wait).toBe(5000);
});

test('the visitor need not wait, and does not try twice', () => {
  const { connection } = connect();
  ScriptedSocket.last.hangUp(FULL, 1013, true);
  vi.advanceTimersByTime(1000);
  connection.open();
  connection.open();
  expect(ScriptedSocket.all).toHaveLength(2);
  vi.advanceTimersByTime(60_000); // the handshake takes its time
  expect(ScriptedSocket.all).toHaveLength(2);
});

test('a session that ended is not resumed, and nobody is called back who went away', () => {
  const { connection, endings } = connect();
  ScriptedSocket.last.welcome();
  const sentence = 'Nothing was said for 10 min, so this conversation has ended.';
  ScriptedSocket.last.hangUp(sentence, 1000, true);
  expect(endings).toEqual([{ sentence, again: true, wait: null }]);
  expect(connection.send({ type: 'text', text: 'Hello?' })).toBe(false);
  expect(nextTry()).toBe(null);
  connection.open();
  ScriptedSocket.last.welcome();
  expect(ScriptedSocket.last.of('hello')).toMatchObject([{ session: null, last_index: -1 }]);
  expect(connection.send({ type: 'text', text: 'Hello?' })).toBe(true);
});

test('who hangs up is not called back, and begins anew when they want to', () => {
  const { connection, endings, told } = connect();
  ScriptedSocket.last.welcome();
  connection.hangUp();
  expect(ScriptedSocket.last.closed).toBe(true);
  expect(endings).toEqual([{ sentence: say('ended'), again: true, wait: null }]);
  expect(connection.send({ type: 'text', text: 'Hello?' })).toBe(false);
  expect(nextTry()).toBe(null);
  connection.open();
  ScriptedSocket.last.welcome({ session: 'second' });
  expect(ScriptedSocket.last.of('hello')).toMatchObject([{ session: null, last_index: -1 }]);
  expect(told).toEqual(['welcome, resumed false, replaced false', 'welcome, resumed false, replaced false']);
});

test('what a new session would not mend is not tried again', () => {
  const { endings } = connect();
  const sentence = 'this page speaks version 2 of the protocol, the server version 4: reload the page.';
  ScriptedSocket.last.hangUp(sentence, 1008, false);
  expect(endings).toEqual([{ sentence, again: false, wait: null }]);
  expect(nextTry()).toBe(null);
});

test('a server of another version ends it too', () => {
  const { endings, told } = connect();
  ScriptedSocket.last.welcome({ version: 1 });
  expect(ScriptedSocket.last.closed).toBe(true);
  ScriptedSocket.last.drop(1000);
  expect(endings).toMatchObject([{ again: false, wait: null }]);
  expect(told).toEqual([]);
});

test('a dropped connection resumes its session, and says so when there is none any more', () => {
  const { told } = connect();
  ScriptedSocket.last.welcome();
  ScriptedSocket.last.drop();
  expect(nextTry()).toBe(300);
  ScriptedSocket.last.welcome({ resumed: true });
  expect(ScriptedSocket.last.of('hello')).toMatchObject([{ session: 'first' }]);
  ScriptedSocket.last.drop();
  expect(nextTry()).toBe(300);
  ScriptedSocket.last.welcome({ resumed: false, session: 'second' });
  expect(told).toEqual([
    'welcome, resumed false, replaced false',
    'lost',
    'welcome, resumed true, replaced false',
    'lost',
    'welcome, resumed false, replaced true',
  ]);
});

test('a server that stays away ends the session once it cannot be resumed; trying goes on', () => {
  const { endings, told } = connect();
  ScriptedSocket.last.welcome();
  vi.advanceTimersByTime(120_000); // a long conversation
  const waits = [];
  for (let i = 0; i < 20 && endings.length === 0; i++) {
    ScriptedSocket.last.drop();
    if (endings.length === 0) waits.push(nextTry());
  }
  expect(waits).toEqual([300, 600, 1200, 2400, 4800, 5000, 5000, 5000, 5000, 5000]);
  expect(endings).toEqual([{ sentence: say('unreachable'), again: true, wait: 10_000 }]);
  expect(nextTry()).toBe(10_000);
  ScriptedSocket.last.drop();
  expect(endings.at(-1)!.wait).toBe(20_000);
  expect(nextTry()).toBe(20_000);
  ScriptedSocket.last.welcome();
  expect(ScriptedSocket.last.of('hello')).toMatchObject([{ session: null }]);
  expect(told.at(-1)).toBe('welcome, resumed false, replaced false');
});

test('other services mean another session, which replaces none', () => {
  const { connection, told } = connect();
  ScriptedSocket.last.welcome();
  connection.restart({ voice: 'kokoro' });
  ScriptedSocket.last.drop(1005);
  nextTry();
  ScriptedSocket.last.welcome({ session: 'second' });
  expect(ScriptedSocket.last.of('hello')).toMatchObject([{ session: null, wishes: { voice: 'kokoro' } }]);
  expect(told.at(-1)).toBe('welcome, resumed false, replaced false');
});

test('who has a place in the queue joins by himself, and keeps it through a drop', () => {
  const { connection, endings, told } = connect();
  ScriptedSocket.last.queue(2, null);
  expect(connection.send({ type: 'text', text: 'Is it my turn?' })).toBe(false);
  vi.advanceTimersByTime(600_000); // others talk for long
  ScriptedSocket.last.queue(1, 30);
  for (const wait of [300, 600, 1200]) {
    ScriptedSocket.last.drop();
    expect(nextTry()).toBe(wait);
  }
  ScriptedSocket.last.queue(1, 20);
  expect(ScriptedSocket.last.of('hello')).toMatchObject([{ session: 'place', last_index: -1 }]);
  ScriptedSocket.last.welcome({ session: 'place' });
  expect(connection.send({ type: 'text', text: 'At last!' })).toBe(true);
  expect(endings).toEqual([]);
  expect(told).toEqual(['place 2, null s', 'place 1, 30 s', 'lost', 'lost', 'lost', 'place 1, 20 s', 'welcome, resumed false, replaced false']);
  ScriptedSocket.last.drop();
  nextTry();
  ScriptedSocket.last.welcome({ session: 'place', resumed: true });
  expect(ScriptedSocket.last.of('hello')).toMatchObject([{ session: 'place' }]);
});

test('whose session is lost while all places are taken waits, and is told that another one begins', () => {
  const { told } = connect();
  ScriptedSocket.last.welcome();
  ScriptedSocket.last.drop();
  nextTry();
  ScriptedSocket.last.queue(1, null);
  ScriptedSocket.last.welcome({ session: 'place' });
  expect(told.at(-1)).toBe('welcome, resumed false, replaced true');
});

test('a place in the queue that the server has forgotten is no reason to give up', () => {
  const { endings } = connect();
  ScriptedSocket.last.queue(3, null);
  for (let waited = 0; endings.length === 0; ) {
    ScriptedSocket.last.drop();
    if (endings.length === 0) waited += nextTry()!;
    expect(waited).toBeLessThan(60_000);
  }
  expect(endings).toEqual([{ sentence: say('unreachable'), again: true, wait: 10_000 }]);
  nextTry();
  ScriptedSocket.last.queue(5, null);
  expect(ScriptedSocket.last.of('hello')).toMatchObject([{ session: null }]);
  ScriptedSocket.last.drop();
  expect(nextTry()).toBe(300);
});

describe('a network that has gone without a word', () => {
  /** How long it takes until something is so, ms; not longer than two minutes. */
  function waited(fulfilled: () => boolean): number {
    const began = performance.now();
    while (!fulfilled() && performance.now() - began < 120_000) vi.advanceTimersByTime(100);
    return performance.now() - began;
  }

  function goSilent() {
    const all = connect();
    ScriptedSocket.last.welcome();
    vi.advanceTimersByTime(60_300); // a talk in which nobody says anything
    const first = ScriptedSocket.last;
    first.beats = false;
    return { ...all, first, after: waited(() => all.told.at(-1) === 'lost') };
  }

  test('is noticed within five seconds, and another line is tried at once; typed questions stay', () => {
    const { connection, told, after } = goSilent();
    expect(after).toBeLessThanOrEqual(4500);
    expect(after).toBeGreaterThan(3000); // shorter gaps are usual
    expect(told).toEqual(['welcome, resumed false, replaced false', 'lost']);
    expect(ScriptedSocket.all).toHaveLength(2);
    expect(connection.send({ type: 'text', text: 'Hello?' })).toBe(false);
  });

  test.each([6000, 14_000, 20_000])('costs nothing where it only stalled, for %i ms', (stall) => {
    const { connection, told, first, endings, after } = goSilent();
    vi.advanceTimersByTime(stall - after);
    expect(told.filter((one) => one === 'lost')).toHaveLength(1);
    first.beats = true;
    vi.advanceTimersByTime(1000);
    expect(told.at(-1)).toBe('regained');
    expect(first.closed).toBe(false);
    expect(ScriptedSocket.all.slice(1).map(({ closed }) => closed)).not.toContain(false);
    expect(ScriptedSocket.all.slice(1).flatMap(({ sent }) => sent)).toEqual([]);
    expect(connection.send({ type: 'text', text: 'Hello!' })).toBe(true);
    expect(first.of('text')).toHaveLength(1);
    expect(nextTry()).toBe(null);
    expect(endings).toEqual([]);
  });

  test('is left for the first line that opens, which goes on with the session', () => {
    const { told, first } = goSilent();
    ScriptedSocket.last.drop(); // the first try finds no network
    expect(nextTry()).toBe(300);
    ScriptedSocket.last.welcome({ resumed: true });
    expect(first.closed).toBe(true);
    expect(ScriptedSocket.last.of('hello')).toMatchObject([{ session: 'first' }]);
    expect(told.at(-1)).toBe('welcome, resumed true, replaced false');
    expect(nextTry()).toBe(null);
  });

  test('is waited for no longer than a session, and then ends it as other drops do', () => {
    const { endings, first } = goSilent();
    const silent = waited(() => first.closed); // handshakes get no answer either
    expect(silent).toBeGreaterThan(30_000);
    expect(endings).toEqual([]);
    const gone = waited(() => endings.length > 0);
    expect(gone).toBeGreaterThan(30_000);
    expect(silent + gone).toBeLessThan(90_000);
    expect(endings).toMatchObject([{ sentence: say('unreachable'), again: true }]);
  });

  test('is not what a tab finds that slept', () => {
    const { told } = connect();
    ScriptedSocket.last.welcome();
    ScriptedSocket.last.beats = false;
    const now = performance.now.bind(performance);
    vi.spyOn(performance, 'now').mockImplementation(() => now() + 3_600_000); // an hour passes in which no timer runs
    for (let woken = 0; woken < 3; woken++) vi.advanceTimersToNextTimer();
    ScriptedSocket.last.beats = true;
    vi.advanceTimersByTime(30_000);
    expect(told).toEqual(['welcome, resumed false, replaced false']);
  });
});

test('what a server sends beyond all measure is not heard', () => {
  const heard: unknown[] = [];
  const { connection } = connect((message) => heard.push(message));
  ScriptedSocket.last.welcome();
  const text = JSON.stringify({ type: 'spoken', utterance: 0, first_sample: 0, starts: [], times: [], more: 'x'.repeat(16_000) });
  for (let i = 0; i < 100; i++) ScriptedSocket.last.onmessage?.({ data: text } as MessageEvent<string>);
  expect(heard).toHaveLength(65); // a megabyte
  vi.advanceTimersByTime(1000);
  for (let i = 0; i < 100; i++) ScriptedSocket.last.onmessage?.({ data: text } as MessageEvent<string>);
  expect(heard).toHaveLength(67); // and 32 KiB a second
  connection.close();
});

test('of frames without number, however small, 1,024 are heard at once, and 128 a second', () => {
  const heard: unknown[] = [];
  const { connection } = connect((message) => heard.push(message));
  ScriptedSocket.last.beats = false;
  ScriptedSocket.last.welcome(); // is one of them
  const text = JSON.stringify({ type: 'transcript', text: '1', final: true });
  const flood = () => {
    for (let i = 0; i < 5000; i++) ScriptedSocket.last.onmessage?.({ data: text } as MessageEvent<string>);
  };
  flood();
  expect(heard).toHaveLength(1023);
  vi.advanceTimersByTime(1000);
  flood();
  expect(heard).toHaveLength(1023 + 128);
  connection.close();
});
