import { readdirSync, readFileSync } from 'node:fs';
import { join } from 'node:path';
import { expect, test } from 'vitest';
import { isFor, isForTexts, KEYS } from '../../src/ui/keyboard/keys.ts';

const VIEWER = join(import.meta.dirname, '../..');

/** All code of the page, by its path. */
const sources = readdirSync(join(VIEWER, 'src'), { recursive: true, encoding: 'utf8' })
  .filter((path) => path.endsWith('.ts'))
  .map((path) => [path, readFileSync(join(VIEWER, 'src', path), 'utf8')] as const);

test('nothing compares keys with others than those of which the help tells', () => {
  const own = sources.filter(([, text]) => /\.(key|code)\b[^;\n]*(===|!==) *['"]/.test(text)).map(([path]) => path);
  expect(own).toEqual([]);
});

test('what HTML tells of keys is so', () => {
  const html = readFileSync(join(VIEWER, 'index.html'), 'utf8');
  const told = [...html.matchAll(/id="([a-z]+)[^>]*aria-keyshortcuts="(.)"/g)].map(([, id, key]) => [id, key!.toLowerCase()]);
  expect(told.toSorted()).toEqual([['drawer', ...KEYS.transcript], ['help', ...KEYS.help], ['mute', ...KEYS.mute]]);
});

test('letters count, small and capital, but not with keys of the browser', () => {
  const pressed = (key: string, more: Partial<KeyboardEvent> = {}) =>
    ({ key, ctrlKey: false, metaKey: false, altKey: false, composedPath: () => [{ id: '', closest: () => null }], ...more }) as unknown as KeyboardEvent;
  expect([isFor('mute', pressed('M')), isFor('mute', pressed('m')), isFor('mute', pressed('Meta'))]).toEqual([true, true, false]);
  expect([isForTexts(pressed('?')), isForTexts(pressed('?', { ctrlKey: true }))]).toEqual([false, true]);
});
