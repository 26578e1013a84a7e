import { MathUtils, Matrix4, Object3D } from 'three';
import { describe, expect, test } from 'vitest';
import { Face, type Heard } from '../../src/face/face.ts';
import { IdleFace, lidClosure } from '../../src/face/idle.ts';
import { ExpressionTrack } from '../../src/face/track.ts';
import { backAndForth, Poses } from '../../src/head/poses.ts';

const FPS = 25;
const matrix = (...rows: number[][]) => ({
  rows: rows.length,
  columns: rows[0]!.length,
  values: Float32Array.from(rows.flat()),
});

test('an expression track that was joined late holds its first row before that', () => {
  const track = new ExpressionTrack(FPS);
  track.add(2, matrix([3, 0], [5, 2]));
  const out = new Float32Array(2);
  track.at(0, out);
  expect([...out]).toEqual([3, 0]);
});

test('rows that leave a gap are not taken: a face could not be drawn there', () => {
  const track = new ExpressionTrack(FPS);
  const out = new Float32Array(1);
  track.add(5, matrix([5], [6]));
  for (const first of [8, 2 ** 40, 2]) track.add(first, matrix([9], [9]));
  track.add(3, matrix([3], [4])); // what was missing before
  track.add(7, matrix([7]));
  for (const [seconds, value] of [[0, 3], [0.16, 4], [0.22, 5.5], [9, 7]] as const) {
    track.at(seconds, out);
    expect(out[0]).toBeCloseTo(value, 5);
  }
});

describe('an expression track', () => {
  const track = new ExpressionTrack(FPS);
  track.add(0, matrix([0, 10], [1, 20]));
  track.add(2, matrix([3, 0]));
  test.each([
    [-1, [0, 10]],
    [0, [0, 10]],
    [0.02, [0.5, 15]],
    [0.04, [1, 20]],
    [0.05, [1.5, 15]],
    [0.08, [3, 0]],
    [9, [3, 0]],
  ])('is between its rows at %d s', (seconds, expected) => {
    const out = new Float32Array(2);
    track.at(seconds, out);
    out.forEach((value, i) => expect(value).toBeCloseTo(expected[i]!, 5));
  });
});

describe('the face', () => {
  const neutral = Float32Array.of(0);
  const still = () => new IdleFace(neutral, []);
  const track = new ExpressionTrack(FPS);
  track.add(0, matrix([1], [1], [1]));

  test('eases into speech and back, without a jump', () => {
    let now = 0;
    let heard: Heard | null = null;
    const face = new Face(1, still(), () => heard, () => now);
    const out = new Float32Array(1);
    const shown: number[] = [];
    for (let tick = 0; tick < 40; tick++) {
      now = tick / 30;
      heard = tick >= 10 && tick < 25 ? { utterance: 4, seconds: 0, track } : null;
      face.expression(out);
      shown.push(out[0]!);
    }
    expect(shown[10]).toBe(0);
    expect(shown[18]).toBe(1);
    expect(shown[24]).toBe(1);
    expect(shown[32]).toBe(0);
    for (let i = 1; i < shown.length; i++) expect(Math.abs(shown[i]! - shown[i - 1]!)).toBeLessThan(0.35);
  });

  test('says when nothing has changed', () => {
    let now = 5;
    const face = new Face(1, still(), () => null, () => now);
    const out = new Float32Array(1);
    expect(face.expression(out)).toBe(false);
    now = 6;
    expect(face.expression(out)).toBe(false);
  });
});

test('one series of blinks runs through rest, speech and rest again', () => {
  let now = 0;
  let heard: Heard | null = null;
  const draw = () => (seed = (seed * 16807) % 2147483647) / 2147483647;
  const neutral = Float32Array.of(0.1, 0.5);
  let seed = 5;
  const face = new Face(2, new IdleFace(neutral, [0], draw), () => heard, () => now);
  const twin = new IdleFace(neutral, [0], draw);
  const track = new ExpressionTrack(FPS);
  track.add(0, matrix([0.1, 1], [0.1, 1]));
  const [shown, alone] = [new Float32Array(2), new Float32Array(2)];
  const blinks: [number, boolean][] = [];
  let spoken = false;
  const seen: number[] = [];
  for (let tick = 0; tick < 60 * 100; tick++) {
    now = tick / 100;
    spoken = Math.floor(now / 1.3) % 2 === 1;
    heard = spoken ? { utterance: Math.floor(now), seconds: now % 1, track } : null;
    face.expression(shown);
    seen.push(shown[0]!);
    if (shown[0]! > 0.99 && seen.at(-2)! <= 0.99) blinks.push([now, spoken]);
  }
  seed = 5;
  seen.forEach((lid, tick) => {
    twin.at(tick / 100, alone);
    expect(lid).toBe(alone[0]);
  });
  const pauses = blinks.slice(1).map(([at], i) => at - blinks[i]![0]);
  expect(Math.min(...pauses)).toBeGreaterThan(1.98);
  expect(Math.max(...pauses)).toBeLessThan(6.02);
  expect(new Set(blinks.map(([, spoken]) => spoken)).size).toBe(2); // in rest and in speech
});

describe('a resting face', () => {
  test('blinks every few seconds and closes its lids fully', () => {
    const idle = new IdleFace(Float32Array.of(0.1, 0.5), [0], () => 0.5);
    const out = new Float32Array(2);
    const starts: number[] = [];
    let most = 0;
    let before = 0.1;
    for (let t = 0; t < 30; t += 0.01) {
      idle.at(t, out);
      if (before === Math.fround(0.1) && out[0]! > before) starts.push(t);
      before = out[0]!;
      most = Math.max(most, before);
      expect(out[1]).toBe(0.5);
    }
    expect(most).toBeCloseTo(1, 5);
    expect(starts.length).toBeGreaterThan(5);
    for (let i = 1; i < starts.length; i++) expect(starts[i]! - starts[i - 1]!).toBeGreaterThan(2);
  });

  test('blinks from the eyes that a smile has narrowed, which are never nearly shut', () => {
    const idle = new IdleFace(Float32Array.of(0.1), [0], () => 0.5); // the first blink begins after a second
    const lid = (driven: number, seconds: number) => {
      const out = Float32Array.of(driven);
      idle.blinks(seconds, out);
      return out[0]!;
    };
    expect([-1, 0, 0.1].map((driven) => lid(driven, 0))).toEqual([0.1, 0.1, 0.1].map(Math.fround));
    expect(lid(0.25, 0)).toBe(Math.fround(0.25));
    expect(lid(0.9, 0)).toBeCloseTo(0.1 + 0.3 * 0.9);
    expect(lid(0.25, 1.08)).toBeCloseTo(1);
  });

  test('closes faster than it opens', () => {
    expect(lidClosure(-0.1)).toBe(0);
    expect(lidClosure(0.07)).toBe(1);
    expect(lidClosure(0.1)).toBe(1);
    expect(lidClosure(0.18)).toBeGreaterThan(0);
    expect(lidClosure(0.3)).toBe(0);
  });
});

test.each([
  [0, 0],
  [1.25, 1.25],
  [3, 3],
  [3.5, 2.5],
  [5, 1],
  [6, 0],
  [600.5, 0.5],
])('row %d of four runs back and forth', (row, at) => {
  expect(backAndForth(row, 4)).toBe(at);
  expect(backAndForth(row, 1)).toBe(0);
});

describe('poses of a head', () => {
  const turn = (degrees: number, x: number) => new Matrix4().makeRotationY(MathUtils.degToRad(degrees)).setPosition(x, 0, 0);
  const rows = [turn(0, 0), turn(40, 2), turn(-20, 3)].flatMap((matrix) => matrix.transpose().toArray());
  const poses = new Poses(Float32Array.from(rows));
  test.each([
    [-1, 0, 0],
    [0, 0, 0],
    [0.25, 10, 0.5],
    [1, 40, 2],
    [1.5, 10, 2.5],
    [2, -20, 3],
    [7, -20, 3],
  ])('row %d lies between its neighbours, held at the ends', (row, degrees, x) => {
    const object = new Object3D();
    poses.apply(row, object);
    expect(MathUtils.radToDeg(object.rotation.y)).toBeCloseTo(degrees, 4);
    expect(object.position.x).toBeCloseTo(x, 5);
  });
});
