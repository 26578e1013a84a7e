import { describe, expect, test } from 'vitest';
import { leadBack, showWayBack, wayBack } from '../../src/ui/way-back.ts';

const HERE = { protocol: 'http:', hostname: '127.0.0.1' };
const hashOf = (studio: string) => `#${new URLSearchParams({ key: 'a-b', studio })}`;

describe('the way back from a talk to the studio', () => {
  test.each([
    ['http://127.0.0.1:8766/studio#of=Ida&part=left', 'http://127.0.0.1:8766/studio#of=Ida'],
    ['http://127.0.0.1:8766/studio', 'http://127.0.0.1:8766/studio'],
    ['http://127.0.0.1/avatars/~ada/studio?x=1#of=J%C3%BCrgen+%26+Co', 'http://127.0.0.1/avatars/~ada/studio#of=J%C3%BCrgen+%26+Co'],
  ])('from %s is %s', (studio, way) => {
    const talk = new URL('http://127.0.0.1:9999/#key=a-b');
    leadBack(talk, new URL(studio));
    expect(new URLSearchParams(talk.hash.slice(1)).get('key')).toBe('a-b');
    expect(wayBack(talk.hash, HERE)).toBe(way);
  });

  test('tells nobody the studio’s key', () => {
    const talk = new URL('https://desk.local:9999/#key=talk-key');
    leadBack(talk, new URL('https://desk.local:8766/studio#key=studio-key&of=Ida'));
    expect(talk.href).not.toContain('studio-key');
    expect(wayBack(talk.hash, talk)).toBe('https://desk.local:8766/studio#of=Ida');
    expect(wayBack(hashOf('https://desk.local/studio#key=studio-key'), talk)).toBe('https://desk.local/studio');
  });

  test.each([
    'http://evil.example/studio',
    'http://127.0.0.1.evil.example/studio',
    'http://127.0.0.1@evil.example/studio',
    'http://ida:secret@127.0.0.1/studio',
    'http://evil.example\\@127.0.0.1/studio',
    'http:\\\\evil.example\\studio',
    'http:/evil.example/studio',
    '//evil.example/studio',
    '//127.0.0.1/studio',
    '/studio',
    'studio',
    '',
    'https://127.0.0.1/studio',
    'ftp://127.0.0.1/studio',
    'blob:http://127.0.0.1/studio',
    'file://127.0.0.1/studio',
    'javascript://127.0.0.1/%0aalert(1)//studio',
    ' javascript:alert(1)',
    'java\nscript:alert(1)',
    'data:text/html,<script>alert(1)</script>',
    'http://127.0.0.1:8080/delete?all=studio',
    'http://127.0.0.1:8080/delete#/studio',
    'http://127.0.0.1:8080//evil.example/studio',
    'http://127.0.0.1:8080/%2f%2fevil.example/studio',
    'http://127.0.0.1:99999/studio',
    'http://[::1]/studio',
    'http://localhost/studio',
  ])('is none for %j', (studio) => {
    expect(wayBack(hashOf(studio), HERE)).toBeNull();
  });

  test('is none without the studio, from a file, and to a page elsewhere', () => {
    expect(['', '#', '#key=a-b', '#studio'].map((hash) => wayBack(hash, HERE))).toEqual([null, null, null, null]);
    expect(wayBack(hashOf('file:///studio'), { protocol: 'file:', hostname: '' })).toBeNull();
    const talk = new URL('http://127.0.0.1:9999/#key=a-b');
    leadBack(talk, new URL('http://localhost:8766/studio'));
    expect(talk.href).toBe('http://127.0.0.1:9999/#key=a-b');
  });

  test('is shown in each of its links, and only if there is one', () => {
    const links = [1, 2].map(() => ({ href: '', hidden: true }));
    const root = { querySelectorAll: () => links } as unknown as ParentNode;
    showWayBack(root, hashOf('http://evil.example/studio'), HERE);
    expect(links).toEqual([{ href: '', hidden: true }, { href: '', hidden: true }]);
    showWayBack(root, hashOf('http://127.0.0.1:8766/studio#of=Ida'), HERE);
    const shown = { href: 'http://127.0.0.1:8766/studio#of=Ida', hidden: false };
    expect(links).toEqual([shown, shown]);
  });
});
