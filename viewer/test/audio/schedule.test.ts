import { describe, expect, test } from 'vitest';
import { Schedule } from '../../src/audio/schedule.ts';

const LEAD = 1000;

describe('pieces that come in time', () => {
  test('join without a gap or an overlap, whatever their size and whenever they come', () => {
    const schedule = new Schedule(LEAD);
    let first = 0;
    let now = 5000;
    for (const count of [2400, 4800, 2401, 3599, 2400]) {
      expect(schedule.place(first, count, now)).toBe(6000 + first);
      first += count;
      now += 1777;
    }
    expect(schedule.end).toBe(6000 + first);
    expect(schedule.shifted).toBe(0);
  });

  test('play the sample that is due on each frame', () => {
    const schedule = new Schedule(LEAD);
    schedule.place(0, 2400, 0);
    schedule.place(2400, 2400, 100);
    expect(schedule.positionAt(999)).toBe(-1);
    for (const frame of [1000, 1001, 3399, 3400, 5799]) expect(schedule.positionAt(frame)).toBe(frame - 1000);
    expect(schedule.positionAt(9999)).toBe(4800); // held at the end
  });

  test('wait until the utterance before has ended', () => {
    const schedule = new Schedule(LEAD);
    expect(schedule.place(0, 2400, 0, 50_000)).toBe(50_000);
    expect(schedule.place(2400, 2400, 100, 50_000)).toBe(52_400);
  });
});

describe('a piece that comes too late', () => {
  test('moves itself and all that follow', () => {
    const schedule = new Schedule(LEAD);
    schedule.place(0, 2400, 0); // frames 1000 to 3400
    expect(schedule.place(2400, 2400, 4000)).toBe(5000);
    expect(schedule.place(4800, 2400, 4100)).toBe(7400);
    expect(schedule.shifted).toBe(1600);
  });

  test('holds the position, and so the face, until it plays', () => {
    const schedule = new Schedule(LEAD);
    schedule.place(0, 2400, 0);
    schedule.place(2400, 2400, 4000);
    expect(schedule.positionAt(3399)).toBe(2399);
    for (const frame of [3400, 4200, 5000]) expect(schedule.positionAt(frame)).toBe(2400);
    expect(schedule.positionAt(5001)).toBe(2401);
  });

  test('that still just fits is not moved', () => {
    const schedule = new Schedule(LEAD);
    schedule.place(0, 2400, 0);
    expect(schedule.place(2400, 2400, 3400)).toBe(3400);
    expect(schedule.shifted).toBe(0);
  });
});

test('positions only run forward, at the speed of the clock or not at all', () => {
  const schedule = new Schedule(LEAD);
  let now = 0;
  let random = 1;
  for (let piece = 0; piece < 60; piece++) {
    random = (random * 48271) % 0x7fffffff;
    now += random % 4800; // on average as fast as it plays
    schedule.place(2400 * piece, 2400, now);
  }
  expect(schedule.shifted).toBeGreaterThan(0);
  for (let frame = 0; frame < schedule.end; frame += 13) {
    const step = schedule.positionAt(frame + 1) - schedule.positionAt(frame);
    expect(step === 0 || step === 1).toBe(true);
  }
});
