import { expect, test } from 'vitest';
import { RunningSentence } from '../../src/talk/record.ts';

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
