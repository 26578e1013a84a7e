import { afterEach, beforeEach, describe, expect, test, vi } from 'vitest';
import { Captioning, estimated, type Progress } from '../../src/talk/captioning.ts';
import { TalkRecord, type Entry } from '../../src/talk/record.ts';

const RATE = 24_000;

beforeEach(() => void vi.useFakeTimers({ toFake: ['setInterval', 'clearInterval'] }));
afterEach(() => void vi.useRealTimers());

/** Captions of a talk whose loudspeaker is where the test says; what they tell goes into a record, too. */
function listen() {
  let at: { utterance: number; seconds: number } | null = null;
  const told: string[] = [];
  const changes: Entry[] = [];
  const record = new TalkRecord({ changed: (entry) => changes.push(entry), dropped: () => {}, renewed: () => changes.splice(0) });
  const captions = new Captioning(() => at, {
    heard: (progress: Progress) => {
      told.push(progress.text.slice(0, progress.heard));
      record.heard(progress);
    },
    over: (utterance, interrupted) => record.over(utterance, interrupted),
  }, new AbortController().signal);
  const play = (utterance: number, seconds: number) => {
    at = { utterance, seconds };
    vi.advanceTimersByTime(100);
    return told.at(-1);
  };
  const answer = (utterance: number, begin: number, text: string) =>
    captions.answer({ type: 'answer', utterance, first_sample: begin * RATE, text });
  const spoken = (utterance: number, begin: number, starts: number[], times: number[]) =>
    captions.spoken({ type: 'spoken', utterance, first_sample: begin * RATE, starts, times });
  const said = () => record.entries.map(({ who, text }) => `${who}: ${text}`);
  return { captions, record, told, play, answer, spoken, said, changes };
}

describe('captions', () => {
  test('show words when they are heard, wherever their times came', () => {
    const { play, answer, spoken, captions, told } = listen();
    spoken(0, 0, [0, 6, 11], [0.2, 0.9, 1.5]); // before the sentence
    answer(0, 0, 'Hello, good 🙂 day.');
    expect(play(0, 0.1)).toBe('');
    expect(play(0, 0.3)).toBe('Hello,');
    expect(play(0, 1)).toBe('Hello, good'.slice(0, 11));
    answer(0, 2, 'An 🙂 end.');
    spoken(0, 2, [0, 5], [2.1, 2.6]); // after it; code points
    expect(play(0, 2.2)).toBe('An 🙂 ');
    expect(told).toContain('Hello, good 🙂 day.'); // all of the one before
    captions.finish(0);
    expect(told.at(-1)).toBe('An 🙂 end.');
    expect(vi.getTimerCount()).toBe(0);
  });

  test('go at a usual pace until the times are known, and never back', () => {
    const { play, answer, spoken, told } = listen();
    answer(3, 1, 'one two three four');
    expect(play(3, 0.9)).toBeUndefined();
    const words = estimated('one two three four', 1);
    expect(words.map(({ start }) => start)).toEqual([0, 4, 8, 14]);
    words.forEach(({ time }, i) => expect(time).toBeCloseTo(1 + [0, 4, 8, 14][i]! / 14));
    expect(play(3, 1.6)).toBe('one two three ');
    spoken(3, 1, [0, 4, 8, 14], [1, 1.5, 2, 2.5]);
    expect(play(3, 1.7)).toBe('one two three ');
    expect(play(3, 2.6)).toBe('one two three four');
    expect(told).toHaveLength(2);
  });

  test('go word by word also where no spaces are', () => {
    expect(estimated('你好，世界', 0).map(({ start }) => start)).toEqual([0, 3]);
    expect(estimated('你好，世界', 0)[1]!.time).toBeCloseTo(2 / 5 + 1 / 14);
  });

  test('forget what was interrupted', () => {
    const { play, answer, captions, told } = listen();
    answer(0, 0, 'This is said.');
    answer(0, 1, 'This is not.');
    answer(1, 0, 'The next one.');
    play(0, 0.9);
    captions.stop(0);
    const count = told.length;
    play(0, 2);
    expect(told).toHaveLength(count);
    expect(play(1, 2)).toBe('The next one.');
  });
});

describe('a record', () => {
  test('holds what was heard, by whom', () => {
    const { record, play, answer, captions, said } = listen();
    record.asked('Who are you?');
    answer(0, 0, 'I am Stella.');
    answer(0, 2, 'And you?');
    expect(said()).toEqual(['you: Who are you?']);
    play(0, 0.01);
    expect(said()).toEqual(['you: Who are you?', 'avatar: I']);
    play(0, 3.9);
    captions.finish(0);
    expect(said().at(-1)).toBe('avatar: I am Stella. And you?');
    record.asked(' ');
    expect(record.entries).toHaveLength(2);
  });

  test('breaks off where somebody interrupted', () => {
    const { play, answer, captions, said, record } = listen();
    answer(0, 0, 'One two three four five six.');
    play(0, 0.4);
    captions.stop(0);
    expect(said()).toEqual(['avatar: One two …']);
    expect(record.entries[0]!.cut).toBe(true);
    answer(1, 0, 'Never heard.');
    captions.stop(1);
    expect(record.entries).toHaveLength(1);
  });

  test('is told once, whatever is stopped that nobody says', () => {
    const { play, answer, captions, told } = listen();
    for (let i = 0; i < 9; i++) answer(0, i, `${i}.`);
    play(0, 8.9);
    const before = told.length;
    for (let i = 0; i < 50; i++) captions.stop(-1);
    play(0, 9);
    expect(told.length - before).toBeLessThan(2);
  });

  test('stays through a lost connection, after which the server repeats the question, and goes with the session', () => {
    const { record, said, changes } = listen();
    record.begin(false);
    record.asked('Again?');
    record.begin(true);
    record.asked('Again?');
    expect(said()).toEqual(['you: Again?']);
    record.asked('Again?'); // this time the visitor repeats it
    expect(said()).toHaveLength(2);
    record.begin(false);
    expect([said(), changes]).toEqual([[], []]);
  });

  test('puts no spaces where a language has none', () => {
    const { play, answer, captions, said } = listen();
    answer(0, 0, '你好。');
    answer(0, 1, '很高兴认识你。');
    play(0, 0.5);
    captions.finish(0);
    expect(said()).toEqual(['avatar: 你好。很高兴认识你。']);
  });
});
