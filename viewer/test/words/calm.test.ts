import { describe, expect, test } from 'vitest';
import { PageError, sentenceOf } from '../../src/errors.ts';
import { decode } from '../../src/talk/wire.ts';
import { brief, calm } from '../../src/words/calm.ts';

const letters = 'a'.repeat(10_000);

describe('marks on a letter', () => {
  test('are as many as writing knows, and a text that has no more stays as it is', () => {
    const thai = 'ไม่เป็นไร ก็ได้ค่ะ';
    for (const text of ['Zoë', 'e\u0301\u0323', thai, '👩‍👩‍👧', '日本語']) expect(calm(text)).toBe(text);
    expect(calm(`a${'\u0301'.repeat(480_000)}b`)).toBe(`a${'\u0301'.repeat(16)}b`);
  });

  test.each(['\u109a\u200d', '\u{1f3fb}', '\u00ad', '\u{e0061}', '\u0301\u200c', '\uff9e'])('so are joiners, tags, tones of skin and their mixtures: %j', (more) => {
    expect([...calm(`a${more.repeat(8000)}b`)].length).toBeLessThanOrEqual(2 + 16);
  });

  test('words have places to break, but for scripts that break where they like', () => {
    const nko = '\u07da\u20dd'.repeat(2000);
    const broken = calm(nko);
    expect(broken.replaceAll('\u200b', '')).toBe(nko);
    expect(Math.max(...broken.split('\u200b').map((word) => word.length))).toBeLessThanOrEqual(116);
    expect(broken).not.toMatch(/\u200b\p{M}/u); // no letter loses its mark
    const address = `https://example.org/${'a'.repeat(75)}`;
    for (const text of [address, '漢'.repeat(500), 'かな、カナ'.repeat(100), 'ไม่เป็นไร'.repeat(40)]) expect(calm(text)).toBe(text);
  });

  test.each(['\u302a', '\u3099', '\uff9e', '\u0e34', '\u1036', '\u17b7'])('also with marks of such scripts in them: %j', (mark) => {
    const word = `${'\u07da\u20dd'.repeat(40)}${mark}`.repeat(40);
    const broken = calm(word);
    expect(broken.replaceAll('\u200b', '')).toBe(word);
    expect(Math.max(...broken.split('\u200b').map((part) => part.length))).toBeLessThanOrEqual(117);
    expect(broken).not.toMatch(/\u200b\p{M}/u);
  });

  test.each(['α', '\u1100', '\u07da\u20dd', 'aé'])('words that are nearly long cost no more than others: %j', (letters) => {
    const seconds = (text: string) => {
      const begun = performance.now();
      for (let i = 0; i < 40; i++) calm(text);
      return (performance.now() - begun) / 1000;
    };
    const [long, short] = [99, 9].map((length) => `${letters.repeat(Math.floor(length / letters.length))} `.repeat(400).slice(0, 4000));
    const [first, second] = [0, 1].map(() => seconds(long!) / Math.max(seconds(short!), 0.001));
    expect(Math.min(first!, second!)).toBeLessThan(3); // as long as each letter was looked at a hundred times, nine
  });

  test('a text is no longer than is laid out at once, and one within an error is short', () => {
    expect(calm('漢'.repeat(16_000))).toBe(`${'漢'.repeat(4000)}…`);
    expect(brief('a short one')).toBe('a short one');
    expect(brief(`a${'\u0301'.repeat(480_000)}`)).toBe(`a${'\u0301'.repeat(16)}…`);
    expect(brief(letters).replaceAll('\u200b', '')).toBe(`${'a'.repeat(300)}…`);
    expect(new PageError(letters).sentence).toHaveLength(304);
    expect(sentenceOf(new Error(letters))).toMatchObject({ values: { detail: brief(letters) } });
  });

  test('arguments of a call stay as they are', () => {
    const given = JSON.stringify({ url: `https://example.org/file?token=${letters}` });
    expect(decode(JSON.stringify({ type: 'call', name: 'open', arguments: given }))).toMatchObject({ arguments: given });
  });

  test('so it is in what a server sends', () => {
    const said = decode(JSON.stringify({ type: 'transcript', text: `a${'\u0301'.repeat(9000)}`, final: false }));
    expect(said).toMatchObject({ text: `a${'\u0301'.repeat(16)}` });
  });
});
