import { describe, expect, test } from 'vitest';
import type { BakedLamp, BakedSkinned, BakedSky, SkinnedRows } from '../../src/body/skinned/baked.ts';
import encoded from '../../src/body/skinned/kernel/index.ts?wasm-bytes';
import { Casters } from '../../src/body/skinned/casters.ts';
import { SkinnedGenerator } from '../../src/body/skinned/generator.ts';
import { axesOf, ShadowMap } from '../../src/body/skinned/shadow.ts';
import { Sky, spiral } from '../../src/body/skinned/sky.ts';
import { SHADOW } from '../../src/shared.ts';
import { makeKernel } from '../../src/soft/kernel.ts';
import { Rasteriser } from '../../src/soft/rasteriser.ts';
import { worst } from '../../support/browser/pictures.ts';
import { clothOf } from '../../support/browser/view.ts';
import { random } from '../../support/random.ts';

type Vector = readonly [number, number, number];

const { radius: RADIUS, texel: TEXEL, side: SIDE, off: OFF, bias: BIAS, edge: EDGE, skyLeast: LEAST } = SHADOW;
const DIRECTIONS = 24;
const still = Float32Array.of(1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 1, 0, 0, 0); // one joint, as at rest

/** Spheres of one joint, 0.1 mm, with the directions that they face. */
function lampOf(points: readonly Vector[], normals: readonly Vector[]): BakedLamp {
  return {
    direction: Float32Array.of(0, 0.6, 0.8),
    strength: new Float32Array(3),
    points: Int16Array.from(points.flat()),
    joints: new Uint8Array(4 * points.length),
    weights: Uint8Array.from(points.flatMap(() => [255, 0, 0, 0])),
    normals: Int8Array.from(normals.flat()),
  };
}

/** One Gaussian at each of the first spheres. */
function onSpheres(count: number): BakedSky {
  const casters = Uint16Array.from({ length: 4 * count }, (_, i) => (i % 4 ? 0 : i / 4));
  return { casters, weights: Uint8Array.from(casters, (_, i) => (i % 4 ? 0 : 255)) };
}

/** The shares of Gaussians at the first spheres. */
function seen(points: readonly Vector[], normals: readonly Vector[], count: number, table = still): number[] {
  const casters = new Casters(lampOf(points, normals), 1);
  const sky = new Sky(casters, DIRECTIONS, count);
  sky.add(onSpheres(count));
  casters.pose(table);
  sky.look();
  return [...sky.shares];
}

/** A square of spheres 2 cm apart, (2·half + 1)² of them, at a height in units of 0.1 mm. */
function plate(half: number, height: number): Vector[] {
  const steps = Array.from({ length: 2 * half + 1 }, (_, i) => 200 * (i - half));
  return steps.flatMap((x) => steps.map((z): Vector => [x, height, z]));
}

describe('the light from all around', () => {
  test('comes from directions that are evenly spread', () => {
    const all = spiral(DIRECTIONS);
    expect(all[0]).toEqual([0, 0, 1]);
    expect(all.at(-1)![2]).toBe(-1);
    for (const direction of all) expect(Math.hypot(...direction)).toBeCloseTo(1, 12);
    expect(all[1]![0]).toBeCloseTo(Math.sqrt(1 - (21 / 23) ** 2) * Math.cos(Math.PI * (3 - Math.sqrt(5))), 12);
    for (let axis = 0; axis < 3; axis++) expect(Math.abs(all.reduce((sum, direction) => sum + direction[axis]!, 0))).toBeLessThan(0.6);
  });

  test('reaches a sphere alone as a whole, wherever it faces', () => {
    for (const normal of [[0, 0, 127], [0, -5, 0], [90, 90, 0], [-20, 70, -110]] as const) {
      expect(seen([[100, 9000, -200]], [normal], 1)[0]).toBeCloseTo(1, 6);
    }
  });

  test('is hidden by a plate as far as directions meet it', () => {
    const height = 0.3; // m above the middle's skin
    const half = 0.31; // m, of the plate with its spheres' edges
    const points: Vector[] = [[0, 0, 0], ...plate(15, 1e4 * (height + RADIUS + OFF))];
    const share = seen(points, points.map(() => [0, 127, 0]), 1)[0]!;
    let [open, whole] = [0, 0];
    for (const [x, y, z] of spiral(DIRECTIONS)) {
      if (y <= 0) continue;
      whole += y;
      const aside = (height / y) * Math.max(Math.abs(x), Math.abs(z)); // m, where it passes the plate
      if (aside > half) open += y;
    }
    expect(open / whole).toBeLessThan(0.6);
    expect(open / whole).toBeGreaterThan(0.3);
    expect(share).toBeCloseTo(open / whole, 1);
  });

  test('never fails wholly', () => {
    const around = spiral(3000).map(([x, y, z]): Vector => [Math.round(3000 * x), Math.round(3000 * y), Math.round(3000 * z)]); // a ball of 30 cm
    const points: Vector[] = [[0, 0, 0], ...around];
    expect(seen(points, points.map(() => [0, 127, 0]), 1)[0]).toBeCloseTo(LEAST, 6);
  });

  test('is looked for where a pose takes the spheres, and as it turns them', () => {
    const points: Vector[] = [[0, 0, 0], ...plate(15, 3300)];
    const normals = points.map((): Vector => [0, 127, 0]);
    const turned = Float32Array.of(1, 0, 0, 3, 0, 0, -1, -40, 0, 1, 0, 2, Math.SQRT1_2, Math.SQRT1_2, 0, 0); // by 90° about x
    const upright = points.map(([x, y, z]): Vector => [x, -z, y]);
    const expected = seen(upright, normals.map(() => [0, 0, 127]), 1)[0]!;
    expect(seen(points, normals, 1, turned)[0]).toBeCloseTo(expected, 1); // the map's texels lie elsewhere
    expect(expected).toBeLessThan(0.6);
  });

  test('is there for what no pose can be, and takes no time to it', () => {
    for (const far of [1e30, -3e9, Infinity, NaN]) {
      const table = still.with(3, far).with(7, far);
      expect(seen([[0, 0, 0], [0, 500, 0]], [[0, 127, 0], [0, 127, 0]], 2, table)).toHaveLength(2);
    }
  });
});

describe('the kernel of the spheres', () => {
  const next = random(5);
  const points = Array.from({ length: 400 }, (): Vector => [Math.round(9000 * (next() - 0.5)), Math.round(30_000 * (next() - 0.5)), Math.round(9000 * (next() - 0.5))]);
  const normals = points.map((): Vector => [Math.round(200 * (next() - 0.5)), Math.round(200 * (next() - 0.5)), 1 + Math.round(100 * next())]);
  const lamp = lampOf(points, normals);
  const casters = new Casters(lamp, 1);
  casters.pose(still);

  test('draws what a plain loop draws, to the bit', () => {
    for (const direction of spiral(7)) {
      const map = new ShadowMap(casters, Float32Array.from(direction));
      map.draw();
      expect(worst(map.depths, drawn(casters.centres, map.axes))).toBe(0);
      expect(map.depths.filter((depth) => depth > -1e8).length).toBeGreaterThan(2500);
    }
  });

  test('finds the light that a plain loop finds', () => {
    const sky = new Sky(casters, DIRECTIONS, points.length);
    sky.add(onSpheres(points.length));
    sky.look();
    const expected = looked(casters);
    expect(worst(expected, sky.shares)).toBeLessThan(1e-4);
    expect(Math.min(...expected)).toBeLessThan(0.9);
    expect(Math.max(...expected)).toBeCloseTo(1, 5);
  });

  test('is so small that every browser compiles it at once', () => expect(atob(encoded).length).toBeLessThan(4096));

  test('does nothing for a pose that it has', () => {
    const other = still.with(3, 0.5);
    expect([other, other, other.slice(), still].map((table) => casters.pose(table))).toEqual([true, false, false, true]);
  });
});

/** What is drawn of spheres by some axes, one texel after the other. */
function drawn(centres: Float64Array, axes: Float64Array): Float32Array {
  const depths = new Float32Array(SIDE * SIDE).fill(-1e9);
  const reach = RADIUS / TEXEL;
  for (let i = 0; i < centres.length; i += 3) {
    const [across, up, towards] = [0, 3, 6].map((at) => axes[at]! * centres[i]! + axes[at + 1]! * centres[i + 1]! + axes[at + 2]! * centres[i + 2]!) as [number, number, number];
    const [x, y] = [across / TEXEL, up / TEXEL];
    for (let row = Math.ceil(y - reach); row <= y + reach; row++) {
      for (let column = Math.ceil(x - reach); column <= x + reach; column++) {
        const left = reach * reach - (column - x) * (column - x) - (row - y) * (row - y);
        const place = (row & (SIDE - 1)) * SIDE + (column & (SIDE - 1));
        if (left >= 0) depths[place] = Math.max(depths[place]!, towards + TEXEL * Math.sqrt(left));
      }
    }
  }
  return depths;
}

/** The share of the light from all around that reaches the skin above each sphere. */
function looked({ centres, normals }: Casters): number[] {
  const maps = spiral(DIRECTIONS).map((direction) => ({ direction, axes: axesOf(direction), depths: drawn(centres, axesOf(direction)) }));
  return Array.from({ length: centres.length / 3 }, (_, i) => {
    const normal = normals.subarray(3 * i, 3 * i + 3);
    const place = normal.map((part, k) => centres[3 * i + k]! + (RADIUS + OFF) * part);
    let [open, whole] = [0, 0];
    for (const { direction, axes, depths } of maps) {
      const cosine = direction.reduce((sum, part, k) => sum + part * normal[k]!, 0);
      if (cosine <= 0) continue;
      const [across, up, towards] = [0, 3, 6].map((at) => place.reduce((sum, part, k) => sum + axes[at + k]! * part, 0)) as [number, number, number];
      const [x, y] = [across / TEXEL, up / TEXEL];
      for (let row = Math.floor(y) - 1; row < Math.floor(y) + 3; row++) {
        for (let column = Math.floor(x) - 1; column < Math.floor(x) + 3; column++) {
          const before = (towards + BIAS - depths[(row & (SIDE - 1)) * SIDE + (column & (SIDE - 1))]!) / EDGE + 0.5;
          open += 0.25 * cosine * (1 - Math.abs(x - column) / 2) * (1 - Math.abs(y - row) / 2) * Math.min(Math.max(before, 0), 1);
        }
      }
      whole += cosine;
    }
    return Math.max(open / whole, LEAST);
  });
}

describe('a body that hides the sky from itself', () => {
  const points: Vector[] = [[0, 0, 0], [0, 5000, 0], ...plate(15, 3300)]; // one below the plate, one above it
  const lamp = lampOf(points, points.map(() => [0, 127, 0]));
  const rows = (sky: BakedSky | null, x: number): SkinnedRows => ({
    count: 1,
    sky,
    means: Float32Array.of(x, 0, 0),
    quats: Int16Array.of(32767, 0, 0, 0),
    logScales: new Float32Array(3).fill(-2),
    colorLogits: new Float32Array(3),
    opacities: Uint8Array.of(255),
    normals: Int8Array.of(0, 127, 0),
    joints: new Uint8Array(4),
    weights: Uint8Array.of(255, 0, 0, 0),
    shapes: new Int8Array(6),
    shapeScales: new Float32Array(2),
  });
  const sees = (caster: number): BakedSky => ({ casters: Uint16Array.of(caster, 0, 1, 0), weights: Uint8Array.of(255, 0, 0, 0) });
  const info = {
    fps: 1, num_frames: 2, num_gaussians: 2, num_shapes: 1, num_moving: 1, num_known: 1, names: ['root'], parents: [-1],
    low: [0, 0, 0], high: [1, 1, 1], num_casters: points.length, num_rest: 1, num_sky: DIRECTIONS,
  } satisfies BakedSkinned['info'];
  const makeBody = (first: BakedSky | null): SkinnedGenerator => {
    const poses = {
      joints: new Float32Array(3), held: Int16Array.of(32767, 0, 0, 0), moving: Uint8Array.of(0),
      rotations: Int16Array.of(32767, 0, 0, 0, 32767, 0, 0, 0), roots: new Float32Array(6), coefficients: new Float32Array(2), known: Int16Array.of(0), kernelWidth: 1,
    };
    const body = new SkinnedGenerator({ info, lamp, poses, light: new Float32Array(24), ...rows(first, -0.5) });
    body.pose(body.skeleton.empty());
    return body;
  };

  /** The red of what is drawn of both Gaussians, at their middles, 0 to 255. */
  const colours = async (first: BakedSky | null, second: BakedSky | null): Promise<number[]> => {
    const body = makeBody(first);
    body.complete(rows(second, 0.5));
    body.grow(1);
    const { soft } = body;
    const rasteriser = new Rasteriser(await makeKernel());
    rasteriser.put(0, soft.source);
    const view = Float32Array.of(1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 2);
    const placed = [{ id: 0, view, drawn: soft.drawn, late: soft.late, values: soft.values }];
    const pixels = rasteriser.draw({ lens: [64, 64, 32, 32], width: 64, height: 64, band: [0, 16], placed }, clothOf([0, 0, 0], 64, 64));
    return [16, 48].map((column) => pixels[4 * (64 * 32 + column)]!);
  };

  test('has the shares of all its Gaussians, whenever they come', () => {
    const body = makeBody(sees(0));
    const hidden = body.sky!.shares[0]!;
    expect(hidden).toBeLessThan(0.6);
    body.complete(rows(sees(1), 0.5));
    expect(body.sky!.shares[0]).toBe(hidden);
    expect(body.sky!.shares[1]).toBeCloseTo(1, 6);
    const { values } = body.soft;
    expect(values.subarray(values.length - body.sky!.shares.length)).toEqual(body.sky!.shares);
  });

  test('is darker by it: sigmoid(logits + log(share))', async () => {
    const hidden = makeBody(sees(0)).sky!.shares[0]!;
    const plain = await colours(null, null);
    const [left, right] = await colours(sees(0), sees(1));
    expect(left! / plain[0]!).toBeCloseTo((2 * hidden) / (1 + hidden), 2);
    expect(Math.abs(right! - plain[1]!)).toBeLessThanOrEqual(1);
    expect(plain[0]).toBeGreaterThan(120);
  });

  test('has none where its Gaussians see no spheres', () => {
    const body = makeBody(null);
    expect(body.sky).toBeNull();
    expect(body.soft.values).toHaveLength(4 * 8 + 4 * 5 + 8 + 16 + SIDE * SIDE);
  });
});
