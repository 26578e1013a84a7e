import { expect, test } from 'vitest';
import { decode } from '../../src/talk/wire.ts';

const ANSWER = { type: 'answer', utterance: 0, first_sample: 0, text: 'Yes.' };
const SERVICE = { name: 'notes', stand_in: true };
const WELCOME = {
  type: 'welcome', version: 9, session: 's', resumed: false, services: { recognition: SERVICE, language: SERVICE, voice: SERVICE },
  notices: [], dictation: null, offers: [], remembers: false,
}; // prettier-ignore

/** What reading a message throws; null if it is taken. */
function refused(message: object | string): string | null {
  try {
    decode(typeof message === 'string' ? message : JSON.stringify(message));
    return null;
  } catch (error) {
    return (error as Error).message;
  }
}

test('what is no text, no number or no list is refused, wherever one is due', () => {
  expect(refused(ANSWER)).toBeNull();
  for (const text of [{}, [], 7, null, true]) expect(refused({ ...ANSWER, text })).toMatch(/^answer does not/);
  for (const utterance of ['0', null, 0.5, 2 ** 53]) expect(refused({ ...ANSWER, utterance })).toMatch(/^answer does not/);
  expect(refused({ type: 'answer', utterance: 0, first_sample: 0 })).toMatch(/^answer does not/);
  expect(refused('{"type":"spoken","utterance":0,"first_sample":0,"starts":[0],"times":[1e999]}')).toMatch(/^spoken/);
  expect(refused({ type: 'spoken', utterance: 0, first_sample: 0, starts: {}, times: [] })).toMatch(/^spoken/);
  expect(refused({ type: 'state', state: 'asleep' })).toMatch(/^state/);
  expect(refused({ type: 'metrics', name: 'x', values: { a: 'b' } })).toMatch(/^metrics/);
  expect(refused({ type: 'timeline', utterance: 0, points: [[0, 1, 2]] })).toMatch(/^timeline/);
  expect(refused({ type: 'timeline', utterance: 0, points: [[0, 1.5]] })).toBeNull();
  expect(refused({ type: 'place', session: 's', position: 1, seconds: null })).toBeNull();
});

test('what lies within a message is looked at as well, and more than is due may stand there', () => {
  expect(refused(WELCOME)).toBeNull();
  expect(refused({ ...WELCOME, later: [1] })).toBeNull();
  expect(refused({ ...WELCOME, services: { ...WELCOME.services, voice: { name: 1, stand_in: false } } })).toMatch(/^welcome/);
  expect(refused({ ...WELCOME, offers: [{ kind: 'ear', key: '', name: '', hindrance: '' }] })).toMatch(/^welcome/);
  expect(refused('{"type":"toString"}')).toMatch(/^unknown/);
});

test('a welcome of another version is read whatever it consists of, so that its number can be told', () => {
  expect(refused({ type: 'welcome', version: 99 })).toBeNull();
});
