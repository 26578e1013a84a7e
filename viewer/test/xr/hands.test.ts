import { Vector3 } from 'three';
import { describe, expect, test } from 'vitest';
import { thrown } from '../../src/xr/teleport.ts';
import { Stick } from '../../src/xr/stick.ts';

describe('what is thrown', () => {
  test('starts at the hand, lands on the floor, and falls as things fall', () => {
    const from = new Vector3(0.2, 1.3, -0.4);
    const direction = new Vector3(0.6, 0.64, -0.48);
    expect(thrown(from, direction, 0)).toEqual(from);
    const end = thrown(from, direction);
    expect(end.y).toBeCloseTo(0, 12);
    const seconds = (end.x - from.x) / (3.5 * direction.x);
    expect(from.y + 3.5 * direction.y * seconds - 0.5 * 9.81 * seconds ** 2).toBeCloseTo(0, 12);
    expect((end.z - from.z) / (3.5 * direction.z)).toBeCloseTo(seconds, 12);
  });

  test('lands under a hand that points straight down', () => {
    const end = thrown(new Vector3(1, 1, 1), new Vector3(0, -1, 0));
    expect(end.distanceTo(new Vector3(1, 0, 1))).toBeLessThan(1e-12);
  });
});

describe('a stick', () => {
  const reading = (...places: [number, number][]) => {
    const stick = new Stick();
    return places.map(([x, y]) => stick.read(x, y));
  };

  test('aims while it is forward, to whichever side, and goes once when it is let go', () => {
    expect(reading([0, -0.5], [0.1, -0.9], [0.9, -0.2], [0.1, -0.1], [0, 0])).toEqual([null, 'aim', 'aim', 'go', null]);
  });

  test('turns once for each push to a side', () => {
    expect(reading([0.9, 0], [1, 0], [0.5, 0], [0.1, 0], [-0.9, 0.2], [0, 0])).toEqual(['right', null, null, null, 'left', null]);
  });

  test('does nothing when it is pulled back, or hardly moved', () => {
    expect(reading([0, 1], [0.2, 0.9], [0.3, -0.3])).toEqual([null, null, null]);
  });
});
