import { describe, expect, test } from 'vitest';
import { linesOf } from '../../src/xr/lines.ts';
import { xrSettings } from '../../src/xr/settings.ts';

describe('lines of captions', () => {
  const width = (text: string) => text.length;

  test('break between words, and hold what there is', () => {
    const text = 'we must find a new home in the stars';
    const lines = linesOf(text, 12, width);
    expect(lines).toEqual(['we must find', 'a new home', 'in the stars']);
  });

  test('never begin with a mark that ends a word', () => {
    expect(linesOf('to turn. It leaves!', 7, width)).toEqual(['to turn.', 'It', 'leaves!']);
    expect(linesOf('新的家园。星空', 4, width)).toEqual(['新的家园。', '星空']);
  });

  test('break in languages without spaces, too', () => {
    const text = '我们必须在星空中找到新的家园';
    const lines = linesOf(text, 5, width);
    expect(lines.length).toBeGreaterThan(2);
    expect(lines.every((line) => line.length <= 5)).toBe(true);
    expect(lines.join('')).toBe(text);
  });

  test('hold a word that is too wide alone; nothing makes no line', () => {
    expect(linesOf('a transformation b', 5, width)).toEqual(['a', 'transformation', 'b']);
    expect(linesOf('', 5, width)).toEqual([]);
  });
});

describe('settings of headsets', () => {
  const read = (given: Record<string, string>) => xrSettings((name) => given[name] ?? null);

  test('are taken as given, within what headsets can do', () => {
    expect(read({ 'xr-scale': '0.6', 'xr-foveation': '0.25' })).toEqual({ scale: 0.6, foveation: 0.25 });
    expect(read({ 'xr-scale': '9', 'xr-foveation': '-1' })).toEqual({ scale: 2, foveation: 0 });
    expect(read({ 'xr-foveation': '0' }).foveation).toBe(0);
  });

  test('are the usual ones where nothing, or nothing sensible, is given', () => {
    const usual = read({});
    expect(usual).toEqual({ scale: 0.8, foveation: 1 });
    expect(read({ 'xr-scale': 'large', 'xr-foveation': ' ' })).toEqual(usual);
  });
});
