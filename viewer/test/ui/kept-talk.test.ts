import { afterEach, beforeEach, expect, test, vi } from 'vitest';
import type { Entry } from '../../src/talk/record.ts';
import { KeptTalk, keepUp } from '../../src/ui/sheets/kept-talk.ts';

const HOME = 'https://museum.example/ada/';
const KEY = `ico3d-talk-${HOME}`;
const AT = Date.UTC(2026, 10, 27, 12);
let kept: Map<string, string>;

beforeEach(() => {
  kept = new Map();
  vi.useFakeTimers();
  vi.stubGlobal('document', new EventTarget());
  vi.stubGlobal('sessionStorage', {
    getItem: (key: string) => kept.get(key) ?? null,
    setItem: (key: string, value: string) => kept.set(key, value),
    removeItem: (key: string) => kept.delete(key),
  });
});
afterEach(() => {
  vi.useRealTimers();
  vi.unstubAllGlobals();
});

const line = (text: string, who: Entry['who'] = 'you', cut = false): Entry => ({ who, at: new Date(AT), text, cut });
const ada = () => new KeptTalk(HOME, 'Ada');

test('what was said is there again after a reload, for this avatar in this part at this address alone', () => {
  const said = [line('Who are you?'), line('I am <b>Ada</b> …', 'avatar', true)];
  ada().write(said);
  expect(ada().read()).toEqual(said);
  expect(new KeptTalk(HOME, 'Grace').read()).toEqual([]);
  expect(new KeptTalk('https://museum.example/grace/', 'Ada').read()).toEqual([]);
  ada().write([]);
  expect([...kept]).toEqual([]);
});

test('the latest lines are kept, and not more than a browser has room for', () => {
  ada().write(Array.from({ length: 1000 }, (_, i) => line(`${i}`)));
  expect(ada().read().map(({ text }) => text)).toEqual(Array.from({ length: 200 }, (_, i) => `${800 + i}`));
  ada().write(Array.from({ length: 100 }, (_, i) => line(`${i} ${'"\u0001é'.repeat(500)}`)));
  const few = ada().read();
  expect(kept.get(KEY)!.length).toBeLessThanOrEqual(60_000);
  expect(kept.get(KEY)!.length).toBeGreaterThan(50_000);
  expect(few.at(-1)!.text).toMatch(/^99 /);
  ada().write([line('short'), line('x'.repeat(100_000))]);
  expect([...kept]).toEqual([]); // nothing older either: it would be read as the end of the talk
});

test.each([
  'null',
  '7',
  '"talk"',
  '[]',
  '{}',
  '{"avatar":"Ada"}',
  '{"avatar":"Ada","lines":{"length":1,"0":["you",1,"x",false]}}',
  '{"avatar":"Ada","lines":[["you",1,"x",false],["you",1,"x"]]}',
  '{"avatar":"Ada","lines":[["me",1,"x",false]]}',
  '{"avatar":"Ada","lines":[["__proto__",1,"x",false]]}',
  '{"avatar":"Ada","lines":[["you","1","x",false]]}',
  '{"avatar":"Ada","lines":[["you",1e300,"x",false]]}',
  '{"avatar":"Ada","lines":[["you",null,"x",false]]}',
  '{"avatar":"Ada","lines":[["you",1,{"toString":"x"},false]]}',
  '{"avatar":"Ada","lines":[["you",1,"x","no"]]}',
  '{"avatar":["Ada"],"lines":[["you",1,"x",false]]}',
  '{"avatar":"Ada","lines":[["you",1,"x",false]',
  `{"avatar":"Ada","lines":[${Array.from({ length: 201 }, () => '["you",1,"x",false]').join()}]}`,
  `{"avatar":"Ada","lines":[["you",1,"${'x'.repeat(60_000)}",false]]}`,
  '['.repeat(59_000),
  'x'.repeat(1_000_000),
  '\u0000\ud800',
  '{',
  '',
])('what is no talk, or not hers, is none: %s', (text) => {
  kept.set(KEY, text);
  expect(ada().read()).toEqual([]);
});

test('where the tab keeps nothing, the talk goes on without', () => {
  vi.stubGlobal('sessionStorage', undefined);
  expect(() => ada().write([line('x')])).not.toThrow();
  expect(ada().read()).toEqual([]);
  vi.stubGlobal('sessionStorage', {
    removeItem: () => {},
    getItem: () => null,
    setItem: () => {
      throw new DOMException('full', 'QuotaExceededError');
    },
  });
  expect(() => ada().write([line('x')])).not.toThrow();
});

test('words are kept together, soon after they were heard, and at once when the page is hidden or left', () => {
  const ending = new AbortController();
  let said = [line('one')];
  const write = vi.spyOn(KeptTalk.prototype, 'write');
  const changed = keepUp(ada(), () => said, ending.signal);
  for (let word = 0; word < 9; word++) changed();
  expect(ada().read()).toEqual([]);
  vi.advanceTimersByTime(500);
  expect(ada().read()).toEqual(said);
  expect(write).toHaveBeenCalledTimes(1);
  said = [line('one two')];
  changed();
  document.dispatchEvent(new Event('visibilitychange'));
  expect(ada().read()).toEqual(said);
  document.dispatchEvent(new Event('visibilitychange'));
  expect(write).toHaveBeenCalledTimes(2); // nothing is new
  said = [line('one two three')];
  changed();
  ending.abort();
  expect(ada().read()).toEqual(said);
  said = [line('one two three …')];
  changed(); // the answer is cut off by the leaving itself
  expect(ada().read()).toEqual(said);
  expect(vi.getTimerCount()).toBe(0);
  write.mockRestore();
});
