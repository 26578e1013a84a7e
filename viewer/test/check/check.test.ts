import { expect, test } from 'vitest';
import { bad, fair, good, none, report, summary, type Finding } from '../../src/check/finding.ts';
import { judgeTrips, socketAdvice } from '../../src/check/network.ts';
import { isSoftware } from '../../src/soft/graphics.ts';
import { judgeGraphics, judgeRate } from '../../src/check/picture.ts';
import { judgeLevel, judgeTone } from '../../src/check/sound.ts';
import { english, say, textOf, type Language } from '../../src/words/text.ts';

test.each([
  [[], 'All that was checked works.'],
  [[good('a'), none('b')], 'All that was checked works.'],
  [[good('a'), fair('b', 'c')], 'It works, but something could be better.'],
  [[fair('a', 'b'), bad('c', 'd'), good('e')], 'Something does not work: see below what to do.'],
])('the worst finding is what the page says at its top', (findings: Finding[], sentence) => {
  expect(english(summary(findings))).toBe(sentence);
});

test('visitors are asked, not people in general, whether they hear the avatar', () => {
  const asked = (language: Language) => textOf(say('check.sound.ask'), language);
  expect([asked('en'), asked('de'), asked('fr')]).toEqual(['Can you hear the avatar?', 'Hören Sie den Avatar?', 'Entendez-vous l’avatar ?']);
});

test('a report tells what was found and what was not tried', () => {
  const findings = new Map([[say('check.secure'), good('Fine.')], [say('check.sound'), null]]);
  expect(report(findings, ['Browser 1', '360 × 640'])).toBe('Browser 1\n360 × 640\nPage: good – Fine.\nSound: not tried');
});

test.each([
  ['ANGLE (Google, Vulkan 1.3.0 (SwiftShader Device (Subzero)), SwiftShader driver)', 'fair'],
  ['llvmpipe (LLVM 15.0.7, 256 bits)', 'fair'],
  ['ANGLE (Microsoft, Microsoft Basic Render Driver, D3D11)', 'fair'],
  ['Apple GPU', 'good'],
  ['ANGLE (NVIDIA, NVIDIA GeForce RTX 3060, OpenGL 4.6)', 'good'],
])('%s', (renderer, verdict) => {
  const finding = judgeGraphics({ name: renderer, software: isSoftware(renderer) });
  expect(finding.verdict).toBe(verdict);
  expect(english(finding.words)).toContain(renderer);
});

test.each([
  [judgeRate(59.6), 'good', '60 frames'],
  [judgeRate(20), 'fair', '20 frames'],
  [judgeRate(3), 'bad', '3 frames'],
  [judgeTrips([900, 4, 2.25]), 'good', '4 ms'],
  [judgeTrips([200, 400]), 'fair', '400 ms'],
  [judgeLevel(0), 'bad', 'silence'],
  [judgeLevel(0.001), 'fair', 'nothing as loud'],
  [judgeLevel(0.05), 'good', 'hears you'],
  [judgeTone(true), 'good', 'You heard'],
  [judgeTone(false), 'bad', 'did not hear'],
] satisfies [Finding, string, string][])('%o', (finding, verdict, words) => {
  expect(finding.verdict).toBe(verdict);
  expect(english(finding.words)).toContain(words);
  if (verdict !== 'good') expect(finding.advice).toBeTruthy(); // nobody is left alone with what is wrong
});

test('Safari is known to refuse sockets under certificates that were accepted by hand', () => {
  const iphone = 'Mozilla/5.0 (iPhone; CPU iPhone OS 18_0 like Mac OS X) AppleWebKit/605.1.15 Version/18.0 Mobile Safari/604.1';
  const chrome = 'Mozilla/5.0 (Macintosh; Intel Mac OS X 10_15_7) AppleWebKit/537.36 Chrome/140.0 Safari/537.36';
  expect(english(socketAdvice('wss://box/echo', iphone))).toContain('certificate');
  expect(english(socketAdvice('ws://box/echo', iphone))).not.toContain('certificate');
  expect(english(socketAdvice('wss://box/echo', chrome))).not.toContain('certificate');
});
