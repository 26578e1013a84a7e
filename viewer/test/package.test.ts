import { execFileSync, spawnSync } from 'node:child_process';
import { existsSync, mkdirSync, mkdtempSync, readdirSync, readFileSync, rmSync, symlinkSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join, resolve } from 'node:path';
import { gzipSync } from 'node:zlib';
import { build, type Rolldown } from 'vite';
import { afterAll, beforeAll, describe, expect, test } from 'vitest';

const VIEWER = resolve(import.meta.dirname, '..');
const MOST_BYTES = 300_000; // gzipped, without three and Spark

const USE = `
import { mountAvatar, setServer, type AvatarElement, type AvatarHandle } from 'ico3d';
setServer('https://avatar.example');
const avatar: AvatarElement = document.querySelector('ico3d-avatar')!;
const said: boolean = avatar.say('Hello.');
const ready: Promise<void> = avatar.connect();
const handle: Promise<AvatarHandle> = mountAvatar(document.body, { bundle: 'https://avatar.example/bundle', transparent: said });
avatar.addEventListener('speak-end', ({ detail }) => console.log(detail.utterance, detail.interrupted));
// @ts-expect-error: it says texts
avatar.say(1);
void handle.then(({ feed }) => feed({ pcm: new Int16Array(24), face: new Float32Array(8) }));
void ready;
`;

describe('the package that npm makes', () => {
  let folder: string;
  beforeAll(() => {
    folder = mkdtempSync(join(tmpdir(), 'ico3d-'));
    execFileSync('npm', ['pack', '--silent', '--pack-destination', folder], { cwd: VIEWER, stdio: ['ignore', 'ignore', 'inherit'] });
    const archive = readdirSync(folder).find((name) => name.endsWith('.tgz'))!;
    const modules = join(folder, 'node_modules');
    mkdirSync(join(modules, 'ico3d'), { recursive: true });
    execFileSync('tar', ['-xzf', join(folder, archive), '-C', join(modules, 'ico3d'), '--strip-components=1']);
    for (const name of ['three', '@sparkjsdev']) symlinkSync(join(VIEWER, 'node_modules', name), join(modules, name));
    writeFileSync(join(folder, 'use.ts'), USE);
  }, 60_000);
  afterAll(() => rmSync(folder, { recursive: true, force: true }));

  test('is small, and holds neither sources nor three nor Spark', () => {
    const dist = join(folder, 'node_modules/ico3d/dist');
    const scripts = readdirSync(dist).filter((name) => name.endsWith('.js'));
    const bytes = scripts.reduce((sum, name) => sum + gzipSync(readFileSync(join(dist, name))).length, 0);
    console.log(`${scripts.length} scripts, ${(bytes / 1000).toFixed(1)} kB gzipped`);
    expect(bytes).toBeLessThan(MOST_BYTES);
    expect(existsSync(join(folder, 'node_modules/ico3d/src'))).toBe(false);
    expect(scripts.some((name) => readFileSync(join(dist, name), 'utf8').includes('from "three"'))).toBe(true);
  });

  test('has the version of the Python package', () => {
    const { version } = JSON.parse(readFileSync(join(folder, 'node_modules/ico3d/package.json'), 'utf8')) as { version: string };
    const python = readFileSync(join(VIEWER, '../src/ico3d/__init__.py'), 'utf8');
    expect(python).toContain(`__version__ = "${version}"`);
  });

  test('has types that hold without those of its parts', () => {
    const options = ['--strict', '--noEmit', '--target', 'es2023', '--module', 'esnext', '--moduleResolution', 'bundler', '--types', '', '--lib', 'es2023,dom'];
    const found = spawnSync(join(VIEWER, 'node_modules/.bin/tsc'), [...options, 'use.ts'], { cwd: folder, encoding: 'utf8' });
    expect(found.stdout).toBe('');
    expect(found.status).toBe(0);
  });

  test('is bundled without any set-up, with the microphone in it', async () => {
    const input = join(folder, 'use.ts');
    const made = await build({ root: folder, configFile: false, logLevel: 'error', build: { write: false, minify: false, rolldownOptions: { input } } });
    const { output } = made as Rolldown.RolldownOutput;
    const code = output.map((file) => (file.type === 'chunk' ? file.code : '')).join('\n');
    expect(code).toContain('registerProcessor');
    expect(output.filter((file) => file.type === 'asset')).toEqual([]);
  });
});
