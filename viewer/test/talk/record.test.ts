import { expect, test, vi } from 'vitest';
import { newest, RunningSentence, TalkRecord, type Entry } from '../../src/talk/record.ts';

const line = (text: string): Entry => ({ who: 'you', at: new Date(), text, cut: false });

/** What is read while clauses are spoken: [utterance, first sample, text, units heard]. */
function read(...clauses: [number, number, string, number][]): string[] {
  const sentence = new RunningSentence();
  return clauses.map(([utterance, first, text, heard]) => {
    const all = sentence.follow({ utterance, first, text, heard });
    return `${all.text.slice(0, all.heard)}|${all.text.slice(all.heard)}`;
  });
}

test('a clause is read after the beginning of its sentence', () => {
  expect(
    read(
      [0, 0, 'I was baked recently,', 5],
      [0, 0, 'I was baked recently,', 21],
      [0, 9, 'so I am still,', 2],
      [0, 9, 'so I am still,', 14],
      [0, 20, 'as you see, fresh.', 18],
    ),
  ).toEqual([
    'I was| baked recently,',
    'I was baked recently,|',
    'I was baked recently, so| I am still,',
    'I was baked recently, so I am still,|',
    'I was baked recently, so I am still, as you see, fresh.|',
  ]);
});

test('a new sentence begins anew, and so does another answer', () => {
  expect(read([0, 0, 'Of course.', 10], [0, 9, 'Just speak,', 4])).toEqual(['Of course.|', 'Just| speak,']);
  expect(read([0, 0, 'Just speak,', 11], [1, 0, 'Hello,', 0])).toEqual(['Just speak,|', '|Hello,']);
  expect(read([0, 9, 'just speak,', 11], [0, 0, 'Hello,', 6])).toEqual(['just speak,|', 'Hello,|']); // of a new session
});

test('scripts without spaces get none', () => {
  expect(read([0, 0, '你好，', 3], [0, 9, '我是艾丽丝。', 2])).toEqual(['你好，|', '你好，我是|艾丽丝。']);
});

test('a talk is earlier than the next one; of one in which the visitor said nothing no line stays', () => {
  const record = new TalkRecord({ changed: () => {}, dropped: () => {}, renewed: () => {} }, [line('before')]);
  const texts = () => [record.earlier, record.entries, record.lasting].map((lines) => lines.map(({ text }) => text));
  const greet = () => record.heard({ utterance: 0, first: 0, text: 'Hello.', heard: 6 });
  record.begin(false);
  greet();
  expect(texts()).toEqual([['before'], ['Hello.'], ['before']]);
  record.begin(false);
  greet();
  record.asked('Who?');
  expect(texts()).toEqual([['before'], ['Hello.', 'Who?'], ['before', 'Hello.', 'Who?']]);
  record.begin(true);
  expect(texts()[1]).toEqual(['Hello.', 'Who?']);
  record.begin(false);
  expect(texts()).toEqual([['before', 'Hello.', 'Who?'], [], ['before', 'Hello.', 'Who?']]);
});

test('after the server has ended a talk nothing of it stays, nor after it was cleared', () => {
  const renewed = vi.fn();
  const record = new TalkRecord({ changed: () => {}, dropped: () => {}, renewed }, [line('before')]);
  record.begin(false);
  record.asked('Who?');
  record.close();
  expect([record.lasting.length, record.entries.length]).toEqual([0, 1]); // it can still be read
  record.begin(false);
  expect([record.earlier, record.entries]).toEqual([[], []]);
  record.asked('And who are you?');
  record.heard({ utterance: 1, first: 0, text: 'I am Ada.', heard: 4 });
  record.clear();
  expect([record.earlier, record.entries, renewed.mock.calls.length]).toEqual([[], [], 3]);
  record.heard({ utterance: 1, first: 0, text: 'I am Ada.', heard: 9 }); // what is still being said
  record.asked('Still there?');
  expect(record.lasting.map(({ text }) => text)).toEqual(['I am Ada.', 'Still there?']);
});

test('a record has room for a thousand entries, and drops the oldest', () => {
  const dropped: Entry[] = [];
  const record = new TalkRecord({ changed: () => {}, dropped: (entry) => dropped.push(entry), renewed: () => {} });
  for (let i = 0; i < 1003; i++) record.asked(`${i}`);
  expect(record.entries.length).toBe(1000);
  expect(dropped.map(({ text }) => text)).toEqual(['0', '1', '2']);
});

test('a record has room for two hundred thousand letters, of this talk and of those before it', () => {
  const dropped: Entry[] = [];
  const record = new TalkRecord({ changed: () => {}, dropped: (entry) => dropped.push(entry), renewed: () => {} });
  for (let i = 0; i < 60; i++) record.asked('a'.repeat(4000));
  expect([record.entries.length, dropped.length]).toEqual([50, 10]);
  record.heard({ utterance: 0, first: 0, text: 'b'.repeat(5000), heard: 3000 });
  expect(record.entries.length).toBe(50);
  record.heard({ utterance: 0, first: 0, text: 'b'.repeat(5000), heard: 5000 }); // it grows into the room of another one
  record.over(0, true);
  expect([record.entries.length, record.answered]).toEqual([49, `${'b'.repeat(5000)} …`]);
  record.begin(false);
  for (let i = 0; i < 30; i++) record.asked('c'.repeat(4000));
  expect([record.entries.length, record.lasting.length, record.lasting.at(19)!.text[0]]).toEqual([30, 49, 'c']);
  record.clear();
  record.asked('d'.repeat(300_000)); // the last one stays, whatever it is
  expect(record.entries.length).toBe(1);
});

test('the newest entries are those at the end, so many and with so many letters', () => {
  const entries = ['one', 'two', 'three', 'four'].map(line);
  const texts = (most: number, letters: number) => newest(entries, most, letters).map(({ text }) => text);
  expect(texts(9, 99)).toEqual(['one', 'two', 'three', 'four']);
  expect(texts(2, 99)).toEqual(['three', 'four']);
  expect(texts(9, 9)).toEqual(['three', 'four']);
  expect(texts(9, 8)).toEqual(['four']);
  expect(texts(9, 3)).toEqual([]);
});

test('an answer without an end is kept as far as eight thousand letters, quickly', () => {
  const record = new TalkRecord({ changed: () => {}, dropped: () => {}, renewed: () => {} });
  const sentence = new RunningSentence();
  const text = 'a'.repeat(99);
  const begin = performance.now();
  for (let i = 0; i < 1000; i++) {
    const progress = { utterance: 0, first: i, text, heard: 99 };
    record.heard(progress);
    expect(sentence.follow(progress).text.length).toBeLessThanOrEqual(4100);
  }
  expect(record.answered.length).toBe(80 * 100 - 1);
  expect(performance.now() - begin).toBeLessThan(2000); // it was half a minute
  record.heard({ utterance: 0, first: 5, text: 'b'.repeat(16_000), heard: 9 }); // in the place of another one
  record.heard({ utterance: 0, first: 1000, text: '', heard: 0 });
  expect(record.answered.length).toBe(80 * 100 - 1);
  record.heard({ utterance: 0, first: 7, text: 'c'.repeat(99), heard: 98 });
  expect(record.answered).toContain('c'.repeat(98));
  record.over(0, true);
  expect(record.answered.endsWith('a …')).toBe(true);
});

test('of talks before this one the last two hundred entries are kept', () => {
  const record = new TalkRecord({ changed: () => {}, dropped: () => {}, renewed: () => {} });
  for (let i = 0; i < 250; i++) {
    record.begin(false);
    record.asked(`${i}`);
  }
  expect([record.earlier.length, record.earlier.at(-1)!.text]).toEqual([200, '248']);
});

test('clauses that end in a mark stay apart, so that no more marks belong to a letter than each clause has', () => {
  const record = new TalkRecord({ changed: () => {}, dropped: () => {}, renewed: () => {} });
  const text = `a${'\u0301'.repeat(15)}\u309a`;
  for (let first = 0; first < 100; first++) record.heard({ utterance: 0, first, text, heard: text.length });
  expect(record.answered).toBe(Array<string>(100).fill(text).join(' '));
});
