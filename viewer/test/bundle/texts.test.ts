import { describe, expect, test } from 'vitest';
import { badText, calm } from '../../src/bundle/texts.ts';
import { decode } from '../../src/talk/wire.ts';

const good = {
  name: 'Ada',
  persona: { name: 'Ada', greeting: 'Hello.', languages: ['en', 'pt-BR', 'zh-Hant'], suggestions: ['Who are you?'] },
  provenance: { kind: 'portrait', sources: ['a film'], consent: 'yes', licence: 'CC0', parts: [{ name: 'head' as const, kind: 'portrait', likeness: 'Ada' }] },
};
const letters = 'a'.repeat(10_000);

describe('texts of a bundle', () => {
  test('are those that a server allows', () => {
    expect(badText(good)).toBe(null);
    expect(badText({ ...good, persona: { name: '', greeting: '' } })).toBe(null); // older ones say no more
  });

  test.each([
    ['name', { ...good, name: letters }],
    ['persona.name', { ...good, persona: { ...good.persona, name: letters } }],
    ['persona.greeting', { ...good, persona: { ...good.persona, greeting: letters } }],
    ['persona.languages', { ...good, persona: { ...good.persona, languages: Array<string>(330_000).fill('') } }],
    ['persona.languages', { ...good, persona: { ...good.persona, languages: [''] } }],
    ['persona.suggestions', { ...good, persona: { ...good.persona, suggestions: Array<string>(13).fill('?') } }],
    ['provenance.sources', { ...good, provenance: { ...good.provenance, sources: [letters] } }],
    ['provenance.likeness', { ...good, provenance: { ...good.provenance, likeness: letters } }],
    ['provenance.parts', { ...good, provenance: { ...good.provenance, parts: Array(46_000).fill(good.provenance.parts[0]) } }],
    ['provenance.parts.likeness', { ...good, provenance: { ...good.provenance, parts: [{ name: 'head' as const, kind: '', likeness: letters }] } }],
  ])('%s is refused where it is longer', (key, told) => {
    expect(badText(told)).toBe(key);
  });
});

describe('marks on a letter', () => {
  test('are as many as writing knows, and a text that has no more stays as it is', () => {
    const thai = 'ไม่เป็นไร ก็ได้ค่ะ';
    for (const text of ['Zoë', 'e\u0301\u0323', thai, '👩‍👩‍👧', '日本語']) expect(calm(text)).toBe(text);
    expect(calm(`a${'\u0301'.repeat(480_000)}b`)).toBe(`a${'\u0301'.repeat(16)}b`);
  });

  test('so it is in what a server sends', () => {
    const said = decode(JSON.stringify({ type: 'transcript', text: `a${'\u0301'.repeat(9000)}`, final: false }));
    expect(said).toMatchObject({ text: `a${'\u0301'.repeat(16)}` });
  });
});
