import { describe, expect, test } from 'vitest';
import { without } from '../../src/stage/webgl/ordering.ts';

describe('an order of Gaussians', () => {
  const order = Uint32Array.of(7, 0, 5, 2, 9, 3, 0xffffffff, 0xffffffff);

  test('without some spans keeps the order of the others', () => {
    const left = without({ order, count: 6 }, [{ base: 2, count: 2 }, { base: 9, count: 1 }]);
    expect(left.count).toBe(3);
    expect([...left.order.subarray(0, 3)]).toEqual([7, 0, 5]);
    expect(left.order.length).toBe(order.length);
  });

  test('without any span is as it was', () => {
    expect([...without({ order, count: 6 }, []).order.subarray(0, 6)]).toEqual([...order.subarray(0, 6)]);
  });
});
