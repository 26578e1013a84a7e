import { expect, test } from 'vitest';
import type { Provenance } from '../../src/bundle/texts.ts';
import { rowsOf } from '../../src/ui/sheets/origin.ts';
import { textOf } from '../../src/words/text.ts';

const FULL = {
  kind: 'portrait',
  sources: ['me.mp4', 'hall'],
  consent: 'agreed in writing',
  licence: 'ours',
  likeness: 'Jane Doe',
  made_by: 'The museum',
  made_on: '2026-11-24',
};
const read = (provenance: Provenance) =>
  rowsOf(provenance).map(([name, ...values]) => [textOf({ key: name }, 'en'), values.map((value) => textOf(value, 'en')).join(' | ')]);

test('all that a bundle states is told', () => {
  expect(read(FULL)).toEqual([
    ['Likeness of', 'Jane Doe'],
    ['Consent', 'agreed in writing'],
    ['Made from', 'me.mp4 | hall'],
    ['Licence', 'ours'],
    ['Made by', 'The museum'],
    ['Made on', '2026-11-24'],
  ]);
});

test('what it does not state is said to be so', () => {
  const { likeness: _, made_by: __, made_on: ___, ...older } = FULL;
  const told = Object.fromEntries(read({ ...older, consent: 'not stated', sources: [] }));
  expect(told).toEqual({
    'Likeness of': 'not stated',
    Consent: 'not stated',
    'Made from': 'not stated',
    Licence: 'ours',
    'Made by': 'not stated',
    'Made on': 'not stated',
  });
});

test('a synthetic person is nobody, who need not agree', () => {
  const told = Object.fromEntries(read({ ...FULL, kind: 'synthetic' }));
  expect(told['Likeness of']).toBe('nobody: this person does not exist');
  expect(told).not.toHaveProperty('Consent');
});

test('of a head on the body of another it is told which part is recorded and which is made', () => {
  const head = { name: 'head', kind: 'portrait', likeness: 'Jane Doe' } as const;
  const body = { name: 'body', kind: 'synthetic', likeness: 'nobody: no such person exists' } as const;
  const told = read({ ...FULL, kind: 'portrait, synthetic', parts: [head, body] });
  expect(told.slice(0, 4)).toEqual([
    ['Likeness of', 'Jane Doe'],
    ['Consent', 'agreed in writing'],
    ['The head', 'recorded: Jane Doe'],
    ['The body', 'made: it shows nobody'],
  ]);
});

test('of a cloned voice it is told from which recording it is, and who agreed to it', () => {
  const voice = { recording: 'me.mp4', consent: 'agreed on 2026-11-26, ticked and spoken' };
  expect(read({ ...FULL, voice }).slice(0, 5)).toEqual([
    ['Likeness of', 'Jane Doe'],
    ['Consent', 'agreed in writing'],
    ['Voice', 'cloned from the recording me.mp4 with OpenVoice; where that is missing, another voice speaks'],
    ['Consent to the voice', 'agreed on 2026-11-26, ticked and spoken'],
    ['Made from', 'me.mp4 | hall'],
  ]);
});
