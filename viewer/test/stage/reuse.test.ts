import type { SparkRenderer } from '@sparkjsdev/spark';
import { Vector3 } from 'three';
import { expect, test } from 'vitest';
import { keepUnchanged } from '../../src/stage/webgl/reuse.ts';

/** As much of Spark's accumulator as the choice needs. */
function makeAccumulator() {
  const accumulator = {
    target: {},
    mappingVersion: 1,
    viewOrigin: new Vector3(),
    viewDirection: new Vector3(0, 0, 1),
    mapping: [] as { generator: string; version: number }[],
    made: [] as string[],
    generate: ({ generator }: { generator: string }) => void accumulator.made.push(generator),
  };
  return accumulator;
}

test('only what changed is made anew, in each place where Spark keeps it', () => {
  const [display, other] = [makeAccumulator(), makeAccumulator()];
  keepUnchanged({ display, accumulators: [other] } as unknown as SparkRenderer);
  const make = (accumulator: typeof display, person: number) => {
    accumulator.made.length = 0;
    accumulator.mapping = [{ generator: 'backdrop', version: 3 }, { generator: 'person', version: person }];
    for (const { generator } of accumulator.mapping) accumulator.generate({ generator });
    return accumulator.made;
  };
  expect(make(display, 1)).toEqual(['backdrop', 'person']);
  expect(make(other, 2)).toEqual(['backdrop', 'person']);
  expect(make(display, 3)).toEqual(['person']);
  expect(make(other, 4)).toEqual(['person']);
  expect(make(other, 4)).toEqual([]);
  display.viewOrigin.x = 1; // depths are those of a view
  expect(make(display, 5)).toEqual(['backdrop', 'person']);
  display.viewDirection.x = 1;
  expect(make(display, 5)).toEqual(['backdrop', 'person']);
  display.mappingVersion = 2; // objects lie elsewhere
  expect(make(display, 5)).toEqual(['backdrop', 'person']);
  display.target = {};
  expect(make(display, 5)).toEqual(['backdrop', 'person']);
  expect(make(display, 5)).toEqual([]);
});
