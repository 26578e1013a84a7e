import { describe, expect, test } from 'vitest';
import { badText } from '../../src/bundle/texts.ts';

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
    ['provenance', { ...good, provenance: { ...good.provenance, sources: Array<string>(6).fill('a'.repeat(3900)) } }],
    ['provenance.likeness', { ...good, provenance: { ...good.provenance, likeness: letters } }],
    ['provenance.parts', { ...good, provenance: { ...good.provenance, parts: Array(46_000).fill(good.provenance.parts[0]) } }],
    ['provenance.parts.likeness', { ...good, provenance: { ...good.provenance, parts: [{ name: 'head' as const, kind: '', likeness: letters }] } }],
  ])('%s is refused where it is longer', (key, told) => {
    expect(badText(told)).toBe(key);
  });
});
