import { expect, test } from 'vitest';
import type { BakedHead, Network } from '../../src/bundle/baked-head.ts';
import { HeadGenerator } from '../../src/head/generator.ts';
import { EYE_UNIT } from '../../src/shared.ts';

/** A network of one hidden unit whose every output is the first value of the expression. */
function network(outputs: number): Network {
  const ones = (length: number) => new Float32Array(length).fill(1);
  return { inputs: 2, hidden: 1, outputs, w1: Float32Array.of(1, 0), b1: new Float32Array(1), w2: ones(outputs), b2: new Float32Array(outputs) };
}

function head(moves: number): BakedHead {
  const rows = { count: 1, rank: 1, moves, means: new Float32Array(3), quats: new Float32Array(4), scales: new Float32Array(3) };
  const look = { meanLogits: new Float32Array(4), basis: new Int8Array(4), basisScale: new Float32Array(1), displacements: new Int8Array(3 * moves) };
  return { ...rows, ...look, network: network(1), moving: network(moves) };
}

test('the last two displacements turn the eyes, whatever the face does', () => {
  const generator = new HeadGenerator(head(4));
  generator.express(Float32Array.of(0.5, 0));
  expect([...generator.steps]).toEqual([0.5, 0.5, 0.5, 0.5]); // nobody looks anywhere
  generator.look(0.2, -0.1);
  const turned = [...Float32Array.of(0.5, 0.5, 0.2 * EYE_UNIT, -0.1 * EYE_UNIT)];
  expect([...generator.steps]).toEqual(turned);
  generator.express(Float32Array.of(0.25, 1));
  expect([...generator.steps]).toEqual([0.25, 0.25, ...turned.slice(2)]);
});
