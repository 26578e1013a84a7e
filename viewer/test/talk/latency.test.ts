import { expect, test } from 'vitest';
import { Latencies, TurnTimer, VoiceMeter } from '../../src/talk/latency.ts';

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

test('figures look back on the last 50 turns', () => {
  const latencies = new Latencies();
  expect(latencies.spread('voice')).toBeNull();
  for (let i = 0; i < 7; i++) latencies.add('voice', 9000);
  for (let i = 50; i > 0; i--) latencies.add('voice', i);
  expect(latencies.spread('voice')!.p50).toBeCloseTo(25.5, 9);
  expect(latencies.spread('voice')!.p95).toBeCloseTo(47.55, 9);
  expect(latencies.spread('turn')).toBeNull();
});
