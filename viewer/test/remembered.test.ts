import { readdirSync, readFileSync } from 'node:fs';
import { join } from 'node:path';
import { afterEach, expect, test, vi } from 'vitest';
import { forgetInTab, remember, remembered, rememberedInTab, rememberInTab } from '../src/remembered.ts';

const SOURCES = join(import.meta.dirname, '../src');

afterEach(() => void vi.unstubAllGlobals());

test('a choice is remembered', () => {
  const kept = new Map<string, string>();
  vi.stubGlobal('localStorage', { getItem: (key: string) => kept.get(key) ?? null, setItem: (key: string, value: string) => kept.set(key, value) });
  expect(remembered('theme')).toBeNull();
  remember('theme', 'light');
  expect([remembered('theme'), [...kept]]).toEqual(['light', [['ico3d-theme', 'light']]]);
});

test('what a tab keeps is kept nowhere else', () => {
  const kept = new Map<string, string>();
  const keeps = {
    getItem: (key: string) => kept.get(key) ?? null,
    setItem: (key: string, value: string) => kept.set(key, value),
    removeItem: (key: string) => kept.delete(key),
  };
  vi.stubGlobal('localStorage', undefined);
  vi.stubGlobal('sessionStorage', keeps);
  expect(rememberedInTab('studio-key')).toBeNull();
  rememberInTab('studio-key', 'a-b');
  expect([rememberedInTab('studio-key'), [...kept]]).toEqual(['a-b', [['ico3d-studio-key', 'a-b']]]);
  forgetInTab('studio-key');
  expect([rememberedInTab('studio-key'), [...kept]]).toEqual([null, []]);
  vi.stubGlobal('sessionStorage', undefined);
  expect(() => rememberInTab('studio-key', 'c-d')).not.toThrow();
  expect(() => forgetInTab('studio-key')).not.toThrow();
  expect(rememberedInTab('studio-key')).toBeNull();
});

test('where the browser keeps nothing, the page goes on without, and asks for it nowhere else', () => {
  vi.stubGlobal('localStorage', undefined);
  Object.defineProperty(globalThis, 'localStorage', {
    configurable: true,
    get() {
      throw new DOMException('refused', 'SecurityError');
    },
  });
  expect(remembered('theme')).toBeNull();
  expect(() => remember('theme', 'light')).not.toThrow();
  const files = readdirSync(SOURCES, { recursive: true, encoding: 'utf8' }).filter((file) => file.endsWith('.ts'));
  const users = files.filter((file) => /localStorage|sessionStorage/.test(readFileSync(join(SOURCES, file), 'utf8')));
  expect(users).toEqual(['remembered.ts']);
});
