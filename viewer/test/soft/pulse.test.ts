import { afterEach, beforeEach, expect, test, vi } from 'vitest';
import { Pulse } from '../../src/soft/pulse.ts';

const REFRESH = 16; // ms

beforeEach(() => {
  vi.useFakeTimers({ toFake: ['setTimeout', 'clearTimeout', 'performance'], now: 0 });
  const next = () => REFRESH - (performance.now() % REFRESH);
  vi.stubGlobal('requestAnimationFrame', (then: (now: number) => void) => setTimeout(() => then(performance.now()), next()));
  vi.stubGlobal('cancelAnimationFrame', clearTimeout);
});
afterEach(() => {
  vi.unstubAllGlobals();
  vi.useRealTimers();
});

/** When pictures begin that take so many ms, within a time. */
function begun(takes: number, during: number): number[] {
  const times: number[] = [];
  let busy = false;
  const pulse = new Pulse(() => busy);
  pulse.run((now) => {
    times.push(now);
    busy = true;
    setTimeout(() => {
      busy = false;
      pulse.done();
    }, takes);
  });
  vi.advanceTimersByTime(during);
  pulse.run(null);
  vi.advanceTimersByTime(during);
  return times;
}

test('pictures that are done in time begin with each refresh', () => {
  expect(begun(10, 5 * REFRESH + 1)).toEqual([1, 2, 3, 4, 5].map((i) => i * REFRESH));
});

test('pictures that take longer than a refresh follow one another at once', () => {
  expect(begun(20, 100)).toEqual([16, 36, 56, 76, 96]);
});

test('a picture that outlasts the end asks for no other', () => {
  expect(begun(60, 70)).toEqual([16]);
});
