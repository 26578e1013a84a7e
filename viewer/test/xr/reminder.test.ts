import { expect, test } from 'vitest';
import { Reminder } from '../../src/xr/reminder.ts';

test('whoever is quiet for a minute is reminded for some seconds, and again after the next', () => {
  const reminder = new Reminder();
  const seconds = Array.from({ length: 140 }, (_, i) => (reminder.pass(1, false) ? i + 1 : 0)).filter(Boolean);
  expect(seconds).toEqual([60, 61, 62, 63, 64, 65, 66, 67, 128, 129, 130, 131, 132, 133, 134, 135]);
});

test('talk ends a reminder, and a minute begins anew', () => {
  const reminder = new Reminder();
  expect(reminder.pass(61, false)).toBe(true);
  expect([reminder.pass(0.1, true), reminder.pass(59, false), reminder.pass(2, false)]).toEqual([false, false, true]);
});
