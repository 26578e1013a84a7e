import { afterEach, beforeEach, expect, test, vi } from 'vitest';
import type { ClientMessage, Dictation as Offer, WelcomeMessage } from '../../src/protocol.ts';
import { Dictation, recognitionOf, type Recognition } from '../../src/talk/dictation.ts';
import { Listening } from '../../src/talk/listening.ts';
import { english } from '../../src/words/text.ts';

/** A browser's recogniser that says what the test wants. */
class Scripted extends EventTarget implements Recognition {
  static last: Scripted;
  continuous = false;
  interimResults = false;
  lang = '';
  onresult: Recognition['onresult'] = null;
  onerror: Recognition['onerror'] = null;
  onend: Recognition['onend'] = null;
  running = false;
  starts = 0;
  track: MediaStreamTrack | undefined;
  private results: ({ isFinal: boolean } & { transcript: string }[])[] = [];

  constructor() {
    super();
    Scripted.last = this;
  }

  start(track?: MediaStreamTrack): void {
    if (this.running) throw new DOMException('already started', 'InvalidStateError');
    this.running = true;
    this.starts++;
    this.track = track;
    this.results = [];
  }

  stop(): void {
    if (this.running) setTimeout(() => this.end(), 20);
  }

  abort(): void {
    this.stop();
  }

  /** Replaces the words of a result. */
  says(index: number, transcript: string, isFinal: boolean): void {
    this.results[index] = Object.assign([{ transcript }], { isFinal });
    this.onresult!({ resultIndex: index, results: this.results });
  }

  fails(error: string): void {
    this.onerror!({ error });
    this.end();
  }

  end(): void {
    this.running = false;
    this.onend!();
  }
}

const TRACK = {} as MediaStreamTrack;

function listening(language = '') {
  const heard: [number, string, boolean][] = [];
  const failed: string[] = [];
  const dictation = new Dictation(
    Scripted,
    language,
    (...words) => heard.push(words),
    (reason) => failed.push(reason),
  );
  dictation.start(TRACK);
  return { dictation, heard, failed, browser: Scripted.last };
}

beforeEach(() => {
  vi.useFakeTimers({ now: 0, toFake: ['setTimeout', 'clearTimeout', 'performance'] });
});
afterEach(() => {
  vi.useRealTimers();
});

test('words come as they are understood, with the number of their result', () => {
  const { heard, browser } = listening('de-DE');
  expect([browser.continuous, browser.interimResults, browser.lang]).toEqual([true, true, 'de-DE']);
  expect(browser.track).toBe(TRACK);
  browser.says(0, 'wie', false);
  browser.says(0, ' wie heißt du ', true);
  browser.says(1, '', false);
  browser.says(1, '你好', true);
  expect(heard).toEqual([
    [0, 'wie', false],
    [0, 'wie heißt du', true],
    [1, '你好', true],
  ]);
});

test('it goes on when the browser ends, and its numbers too', () => {
  const { heard, browser, failed } = listening();
  browser.says(0, 'one', true);
  vi.advanceTimersByTime(60_000);
  browser.end();
  vi.advanceTimersByTime(300);
  expect(browser.starts).toBe(2);
  browser.says(0, 'two', true);
  browser.fails('no-speech');
  vi.advanceTimersByTime(300);
  browser.says(0, 'three', false);
  expect(heard).toEqual([
    [0, 'one', true],
    [1, 'two', true],
    [2, 'three', false],
  ]);
  expect(failed).toEqual([]);
});

test('it stops with the microphone, when the last words have come', () => {
  const { dictation, heard, browser } = listening();
  dictation.stop();
  browser.says(0, 'late', true);
  vi.advanceTimersByTime(5000);
  expect([browser.starts, browser.running]).toEqual([1, false]);
  dictation.start(TRACK);
  browser.says(0, 'again', true);
  expect(heard).toEqual([
    [0, 'late', true],
    [1, 'again', true],
  ]);
});

test('started twice it listens once', () => {
  const { dictation, browser } = listening();
  dictation.start(TRACK);
  vi.advanceTimersByTime(10);
  browser.end();
  dictation.start(TRACK);
  vi.advanceTimersByTime(5000);
  expect([browser.starts, browser.running]).toEqual([2, true]);
});

test.each([true, false])('stopped and started at once it listens once (ended before: %s)', (ended) => {
  const { dictation, browser } = listening();
  if (ended) browser.end();
  dictation.stop();
  dictation.start(TRACK);
  vi.advanceTimersByTime(5000);
  expect([browser.starts, browser.running]).toEqual([2, true]);
});

test.each(['network', 'not-allowed', 'service-not-allowed', 'language-not-supported'])(
  'a browser that says %s is told of once, and left alone',
  (error) => {
    const { failed, browser } = listening();
    browser.fails(error);
    vi.advanceTimersByTime(60_000);
    expect([failed, browser.starts]).toEqual([[error], 1]);
  },
);

test('a browser that ends at once, again and again, is given up', () => {
  const { failed, browser } = listening();
  for (let i = 0; i < 20; i++) {
    if (browser.running) browser.end();
    vi.advanceTimersByTime(300);
  }
  expect(failed).toEqual(['it ends at once']);
  expect(browser.starts).toBe(8);
});

test('browsers have it by two names, or not at all', () => {
  expect(recognitionOf({ SpeechRecognition: Scripted })).toBe(Scripted);
  expect(recognitionOf({ webkitSpeechRecognition: Scripted })).toBe(Scripted);
  expect(recognitionOf({})).toBeNull();
});

function page(Maker: typeof Scripted | null) {
  const sent: ClientMessage[] = [];
  const notices: string[] = [];
  const shared: boolean[] = [];
  const listening = new Listening(
    (message) => sent.push(message) > 0,
    { notice: (sentence) => notices.push(english(sentence)), sharesVoice: (value) => shared.push(value) },
    Maker,
  );
  const welcome = (dictation: Offer | null, resumed = false) =>
    listening.welcome({ dictation, resumed } as WelcomeMessage);
  return { listening, welcome, sent, notices, shared };
}

const OFFER: Offer = { language: '', fallback: 'pocketsphinx' };

test('the page says that the voice is shared, and sends the words', () => {
  const { listening, welcome, sent, notices, shared } = page(Scripted);
  welcome(OFFER);
  expect(Scripted.last.running).toBe(false);
  listening.open(TRACK);
  Scripted.last.says(0, 'hello', true);
  welcome(OFFER, true); // after a dropped connection
  expect(Scripted.last.starts).toBe(1);
  listening.close();
  expect(sent).toEqual([{ type: 'heard', result: 0, text: 'hello', final: true }]);
  expect([notices, shared]).toEqual([[], [true]]);
});

test('a microphone that is open already is listened to', () => {
  const { listening, welcome } = page(Scripted);
  listening.open(TRACK);
  welcome(OFFER);
  expect(Scripted.last.running).toBe(true);
});

test.each([
  ['pocketsphinx', 'pocketsphinx on the server listens instead'],
  [null, 'you can type instead'],
])('where the browser has no recogniser, %s listens', (fallback, instead) => {
  const { welcome, sent, notices, shared } = page(null);
  welcome({ language: '', fallback });
  expect(sent).toEqual([{ type: 'deaf', reason: 'there is none' }]);
  expect(notices).toEqual([`This browser does not recognise speech; ${instead}.`]);
  expect(shared).toEqual([false]);
});

test('a recogniser that fails is not tried again, in no session', () => {
  const { listening, welcome, sent, notices, shared } = page(Scripted);
  welcome(OFFER);
  listening.open(TRACK);
  Scripted.last.fails('network');
  welcome(OFFER, true);
  welcome(OFFER);
  const deaf = { type: 'deaf', reason: 'network' };
  expect(sent).toEqual([deaf, deaf]);
  expect([notices.length, shared, Scripted.last.starts]).toEqual([1, [true, false], 1]);
});

test('where the server listens nothing is asked of the browser', () => {
  const { listening, welcome, sent, shared } = page(Scripted);
  welcome(null);
  listening.open(TRACK);
  expect([sent, shared]).toEqual([[], [false]]);
});
