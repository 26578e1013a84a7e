import { expect, test } from 'vitest';
import { TurnTimer, VoiceMeter } from '../src/talk/latency.ts';

const chunk = (level: number) => Int16Array.from({ length: 640 }, (_, i) => level * Math.sin(i / 3));

test('the meter remembers when the visitor last spoke, and no noise', () => {
  const meter = new VoiceMeter();
  let now = 0;
  const hear = (level: number, chunks: number) => {
    for (let i = 0; i < chunks; i++) meter.hear(chunk(level), (now += 40));
  };
  hear(20, 25);
  expect(meter.lastVoice).toBeNull();
  hear(6000, 10);
  const end = now;
  hear(150, 25);
  expect(meter.lastVoice).toBe(end);
});

test('one question is one figure', () => {
  const timer = new TurnTimer();
  expect(timer.answered(100)).toBeNull();
  timer.asked(200);
  expect(timer.answered(950)).toBe(750);
  expect(timer.answered(1500)).toBeNull();
});
