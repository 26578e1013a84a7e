import type { SparkRenderer } from '@sparkjsdev/spark';
import type { Vector3 } from 'three';

/** Where Spark collects the Gaussians of all objects. */
type Accumulator = SparkRenderer['display'];

/** What an accumulator holds of an object. */
interface Held {
  version: number; // of the object
  origin: Vector3; // of the view by which depths were computed
  direction: Vector3;
}

/**
 * Lets a renderer keep the Gaussians of objects that did not change. Spark makes those of all objects
 * anew when one changes, what stands still behind a person among them.
 */
export function keepUnchanged({ display, accumulators }: SparkRenderer): void {
  for (const accumulator of [display, ...accumulators]) keepIn(accumulator);
}

function keepIn(accumulator: Accumulator): void {
  const held = new Map<unknown, Held>();
  const generate = accumulator.generate.bind(accumulator);
  let place = { target: accumulator.target, mapping: NaN }; // what `held` is of
  accumulator.generate = (order) => {
    const { target, mappingVersion: mapping, viewOrigin: origin, viewDirection: direction } = accumulator;
    if (target !== place.target || mapping !== place.mapping) held.clear();
    place = { target, mapping };
    const version = accumulator.mapping.find(({ generator }) => generator === order.generator)?.version ?? NaN;
    const before = held.get(order.generator);
    const same = before?.version === version && before.origin.equals(origin) && before.direction.equals(direction);
    if (same) return { nextBase: order.base + order.count };
    held.set(order.generator, { version, origin: origin.clone(), direction: direction.clone() });
    return generate(order);
  };
}
