import { afterEach, beforeEach, expect, test, vi } from 'vitest';
import { MAX_NOTE, MAX_NOTES } from '../../src/shared.ts';
import { Notebook } from '../../src/ui/sheets/notebook.ts';

const HOME = 'https://museum.example/ada/';
const KEY = `ico3d-visits-${HOME}`;
let kept: Map<string, string>;

beforeEach(() => {
  kept = new Map();
  vi.stubGlobal('localStorage', {
    getItem: (key: string) => kept.get(key) ?? null,
    setItem: (key: string, value: string) => kept.set(key, value),
    removeItem: (key: string) => kept.delete(key),
  });
});
afterEach(() => void vi.unstubAllGlobals());

/** The notebook of a visitor who agreed. */
function agreed(...said: string[]): Notebook {
  const notebook = new Notebook(HOME);
  notebook.decide(true);
  for (const text of said) notebook.said(text);
  return notebook;
}

test('nothing is kept of a visitor who was not asked, or did not agree', () => {
  const notebook = new Notebook(HOME);
  notebook.said('My name is Grace.');
  expect([notebook.agreed, [...kept]]).toEqual([null, []]);
  notebook.decide(false);
  notebook.said('My name is Grace.');
  expect([notebook.agreed, notebook.notes]).toEqual([false, []]);
});

test('what a visitor says who agreed is there at the next visit, for this server alone', () => {
  agreed('My name is Grace.', 'I like old clocks.');
  expect(new Notebook(HOME).notes).toEqual(['My name is Grace.', 'I like old clocks.']);
  expect(new Notebook('https://elsewhere.example/').agreed).toBeNull();
});

test('each sentence is kept once and whole, without what says nothing later', () => {
  const notebook = agreed('My name', 'My name is Grace.', 'Yes.', 'I like clocks.', ' My  name is\nGrace.\u0000 ', '我喜欢钟表');
  expect(notebook.notes).toEqual(['I like clocks.', 'My name is Grace.', '我喜欢钟表']);
});

test('the oldest go first, and long ones are cut where the server cuts', () => {
  const notebook = agreed(...Array.from({ length: MAX_NOTES + 3 }, (_, i) => `sentence number ${i}`));
  expect(notebook.notes).toHaveLength(MAX_NOTES);
  expect(notebook.notes[0]).toBe('sentence number 3');
  notebook.said(`two words ${'🙂'.repeat(MAX_NOTE)}`);
  expect([...notebook.notes.at(-1)!]).toHaveLength(MAX_NOTE);
  notebook.delete();
  for (let i = 10; i < 10 + MAX_NOTES; i++) notebook.said(`${i} a ${'🙂'.repeat(MAX_NOTE)}`);
  const frame = JSON.stringify({ type: 'notes', texts: notebook.notes });
  expect(new TextEncoder().encode(frame).length).toBeLessThan(16 * 1024); // as much as a server reads
});

test('the visitor deletes one, or all, or takes the consent back', () => {
  const notebook = agreed('My name is Grace.', 'I like old clocks.');
  notebook.delete('My name is Grace.');
  expect(notebook.notes).toEqual(['I like old clocks.']);
  notebook.delete();
  expect([notebook.agreed, notebook.notes]).toEqual([true, []]);
  notebook.said('I am here again.');
  notebook.decide(false);
  notebook.decide(true);
  expect(notebook.notes).toEqual([]);
  expect(kept.get(KEY)).not.toContain('again');
});

test.each(['', '{', 'null', '[]', '{"agreed":1,"notes":[]}', '{"agreed":true,"notes":"all"}', '{"notes":["a b"]}'])(
  'what is no notebook is none: %s',
  (text) => {
    kept.set(KEY, text);
    const notebook = new Notebook(HOME);
    expect([notebook.agreed, notebook.notes]).toEqual([null, []]);
  },
);

test('of what somebody else wrote only sentences are read, and no more than a server takes', () => {
  kept.set(KEY, JSON.stringify({ agreed: true, notes: [3, null, '', ' a\u0007b ', '\ud800 c', ...Array(MAX_NOTES - 2).fill('x'.repeat(999))] }));
  const { notes } = new Notebook(HOME);
  expect(notes.slice(0, 3)).toEqual(['a b', 'c', 'x'.repeat(MAX_NOTE)]);
  expect(notes).toHaveLength(MAX_NOTES);
});

test('where the browser keeps nothing, nobody has agreed', () => {
  vi.stubGlobal('localStorage', undefined);
  const notebook = agreed('My name is Grace.');
  expect([notebook.agreed, notebook.notes]).toEqual([null, []]);
});
