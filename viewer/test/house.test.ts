import { readdirSync, readFileSync } from 'node:fs';
import { dirname, join, relative, resolve } from 'node:path';
import { describe, expect, test } from 'vitest';

const VIEWER = resolve(import.meta.dirname, '..');
const FOLDERS = ['src', 'test', 'e2e', 'bench', 'support'];
const MOST_LINES = 400;
const MOST_FILES = 15; // beside sub-folders

/** The rooms of `src`; each may import those of the lines above its own, none beside it. */
const ORDER = [
  ['numbers.ts', 'gaussians', 'remembered.ts'],
  ['words'],
  ['protocol.ts', 'shared.ts', 'errors.ts', 'actor.ts', 'lifetime.ts', 'server.ts'],
  ['admission.ts'],
  ['soft'],
  ['bundle'],
  ['rig'],
  ['head'],
  ['face'],
  ['motion'],
  ['gesture'],
  ['body', 'stage', 'audio'],
  ['talk'],
  ['ui', 'cast.ts', 'painters'],
  ['xr', 'theatre.ts'],
  ['visit.ts', 'check', 'studio'],
  ['bench.ts'],
  ['main.ts', 'embed'],
];

/** All files under a folder, as paths from `viewer`. */
function filesUnder(folder: string): string[] {
  return readdirSync(join(VIEWER, folder), { withFileTypes: true }).flatMap((entry) => {
    const path = join(folder, entry.name);
    return entry.isDirectory() ? filesUnder(path) : [path];
  });
}

/** Which files of `viewer` a file imports, types among them. */
function importsOf(file: string): string[] {
  const text = readFileSync(join(VIEWER, file), 'utf8');
  const found = text.matchAll(/(?:\bfrom|\bimport\(?)\s*['"](\.[^'"]*)['"]/g);
  return [...found].map(([, path]) => relative(VIEWER, resolve(VIEWER, dirname(file), path!.replace(/\?.*/, ''))));
}

const files = FOLDERS.flatMap(filesUnder);
const graph = new Map(files.filter((file) => file.endsWith('.ts')).map((file) => [file, importsOf(file)]));

/** The first circle of imports, from a file back to itself; empty if there is none. */
function circle(imports: Map<string, string[]>): string[] {
  const done = new Set<string>();
  const walk = (file: string, way: string[]): string[] => {
    if (way.includes(file)) return [...way.slice(way.indexOf(file)), file];
    if (done.has(file)) return [];
    for (const next of imports.get(file) ?? []) {
      const found = walk(next, [...way, file]);
      if (found.length > 0) return found;
    }
    done.add(file);
    return [];
  };
  return [...imports.keys()].map((file) => walk(file, [])).find((found) => found.length > 0) ?? [];
}

/** Imports from one room of `src` into another that is not above it in `ORDER`. */
function arrowsBack(imports: Map<string, string[]>): string[] {
  const room = (file: string) => file.split('/')[1]!;
  const level = (file: string) => ORDER.findIndex((rooms) => rooms.includes(room(file)));
  return [...imports].flatMap(([from, targets]) => {
    const back = targets.filter((to) => room(to) !== room(from) && level(to) >= level(from));
    return back.map((to) => `${from} → ${to}`);
  });
}

const ofSource = new Map([...graph].filter(([file]) => file.startsWith('src/')));

describe('imports', () => {
  test('are found, each of a file that is there', () => {
    expect(graph.size).toBeGreaterThan(80);
    expect(graph.get('src/visit.ts')).toContain('src/talk/conversation.ts');
    for (const [file, imports] of graph) {
      for (const target of imports) expect(['src/style.css', 'index.html', 'vite.config.ts', ...files], file).toContain(target);
    }
  });

  test('never go in a circle', () => {
    expect(circle(graph)).toEqual([]);
    const bent = new Map(graph).set('src/errors.ts', ['src/cast.ts']);
    expect(circle(bent)).toContain('src/errors.ts');
  });

  test('go one way between the rooms of the page', () => {
    const rooms = readdirSync(join(VIEWER, 'src')).filter((name) => name !== 'style.css');
    expect(ORDER.flat().toSorted()).toEqual(rooms.toSorted());
    expect(arrowsBack(ofSource)).toEqual([]);
    const bent = new Map(ofSource).set('src/head/head.ts', ['src/stage/stage.ts']);
    expect(arrowsBack(bent)).toEqual(['src/head/head.ts → src/stage/stage.ts']);
  });

  test('of the page lead to nothing but the page', () => {
    const outside = [...ofSource].flatMap(([file, imports]) => imports.filter((to) => !to.startsWith('src/') && to !== 'index.html').map((to) => `${file} → ${to}`));
    expect(outside).toEqual([]);
  });
});

test(`no file has more than ${MOST_LINES} lines`, () => {
  const texts = files.filter((file) => /\.(ts|css|py)$/.test(file));
  const long = texts.filter((file) => readFileSync(join(VIEWER, file), 'utf8').split('\n').length - 1 > MOST_LINES);
  expect(long).toEqual([]);
});

test(`no folder has more than ${MOST_FILES} files of its own`, () => {
  const counts = new Map<string, number>();
  for (const file of files) counts.set(dirname(file), (counts.get(dirname(file)) ?? 0) + 1);
  expect([...counts].filter(([, count]) => count > MOST_FILES)).toEqual([]);
});
