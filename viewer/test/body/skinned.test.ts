import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { describe, expect, test } from 'vitest';
import { readBakedSkinned } from '../../src/body/skinned/baked.ts';
import { SkinnedGenerator } from '../../src/body/skinned/generator.ts';
import { fillTexels, makeTexels } from '../../src/body/skinned/packed.ts';
import { Skeleton } from '../../src/body/skinned/skeleton.ts';
import { SKINNED } from '../../src/bundle/load.ts';
import { bodyOf, checkManifest } from '../../src/bundle/manifest.ts';
import { parseSafetensors, type Tensor } from '../../src/bundle/safetensors.ts';
import { makeKernel } from '../../src/soft/kernel.ts';
import { Rasteriser } from '../../src/soft/rasteriser.ts';
import { TILE_WIDTH } from '../../src/soft/tiles.ts';
import { psnr, worst } from '../../support/browser/pictures.ts';
import { clothOf, viewOf } from '../../support/browser/view.ts';
import { makeSkinned } from '../../support/references/skinned.ts';
import { arrayBuffer } from '../../support/references/head.ts';

const TIMES = [0, 0.013, 1, 1.237, 2, 9];
const [WIDTH, HEIGHT] = [160, 200];
const reference = makeSkinned({ gaussians: 300, times: TIMES, pictures: `${WIDTH}x${HEIGHT}` });
const read = (name: string) => readFileSync(join(reference.folder, name));
const manifest = checkManifest(JSON.parse(read('manifest.json').toString()));
const info = manifest.skinned!;
const tensors = () => parseSafetensors(arrayBuffer(read(SKINNED)), SKINNED);
const baked = readBakedSkinned(tensors(), info, SKINNED);

/** The largest difference between numbers. */
function off(found: ArrayLike<number>, expected: number[]): number {
  return Math.max(...expected.map((value, i) => Math.abs(found[i]! - value)));
}

describe('a body on a skeleton that Python baked', () => {
  const skeleton = new Skeleton(info, baked.poses);

  test('stands at any time of the recording as in Python', () => {
    for (const { time, rotations, root, residual } of reference.moments.filter(({ time }) => time !== null)) {
      const pose = skeleton.empty();
      skeleton.recorded(time! * info.fps, pose);
      expect(off(pose.rotations, rotations)).toBeLessThan(1e-6);
      expect(off(pose.root, root)).toBeLessThan(1e-6);
      expect(off(pose.residual, residual)).toBeLessThan(1e-6);
    }
  });

  test('has the coefficients that Python interpolates in a pose that was never recorded', () => {
    const { rotations, residual } = reference.moments.at(-1)!;
    const pose = { ...skeleton.empty(), rotations: Float64Array.from(rotations, (value) => -2 * value) }; // the same turns
    skeleton.interpolate(pose);
    expect(off(pose.residual, residual)).toBeLessThan(1e-5);
    expect(Math.max(...residual.map(Math.abs))).toBeGreaterThan(0.1);
  });

  test('is outlined by its joints and its lowest Gaussians, which move with the joint that carries each', () => {
    const generator = new SkinnedGenerator(baked);
    const joints = info.names.length;
    const rest = { ...skeleton.empty(), rotations: Float64Array.from({ length: 4 * joints }, (_, i) => (i % 4 === 0 ? 1 : 0)), root: new Float64Array(3) };
    generator.pose(rest);
    const places = generator.places();
    expect(off(places, [...baked.poses.joints])).toBeLessThan(1e-6);
    const soles = Array.from({ length: places.length / 3 - joints }, (_, i) => [...places.slice(3 * (joints + i), 3 * (joints + i) + 3)]);
    const heights = Array.from({ length: baked.count }, (_, i) => baked.means[3 * i + 1]!);
    const floor = Math.min(...heights);
    expect(soles).toHaveLength(heights.filter((height) => height < floor + 0.03).length);
    expect(Math.min(...soles.map(([, height]) => height!))).toBeCloseTo(floor, 6);
    generator.pose({ ...rest, root: Float64Array.of(0.5, -1, 2) });
    expect(off(generator.places(), [...places].map((value, i) => value + [0.5, -1, 2][i % 3]!))).toBeLessThan(1e-5);
  });

  test('moves its joints as in Python', () => {
    const table = new Float32Array(16 * info.names.length);
    for (const { rotations, root, residual, table: expected } of reference.moments) {
      const given = [rotations, root, residual].map((values) => Float64Array.from(values));
      skeleton.table({ rotations: given[0]!, root: given[1]!, residual: given[2]! }, table);
      expect(off(table, expected)).toBeLessThan(1e-6);
    }
  });

  test('is drawn without WebGL as Python draws it', async () => {
    const body = new SkinnedGenerator(baked);
    const { soft } = body;
    const rasteriser = new Rasteriser(await makeKernel());
    rasteriser.put(0, soft.source);
    const { view, lens } = viewOf(manifest.camera, WIDTH, HEIGHT);
    const cloth = clothOf(manifest.background, WIDTH, HEIGHT);
    for (const [i, { rotations, root, residual }] of reference.moments.entries()) {
      const given = [rotations, root, residual].map((values) => Float64Array.from(values));
      body.pose({ rotations: given[0]!, root: given[1]!, residual: given[2]! });
      const placed = [{ id: 0, view, drawn: soft.drawn, values: soft.values }];
      const picture = rasteriser.draw({ lens, width: WIDTH, height: HEIGHT, band: [0, WIDTH / TILE_WIDTH], placed }, cloth).filter((_, at) => at % 4 < 3);
      expect(psnr(picture, reference.pictures!.subarray(i * picture.length, (i + 1) * picture.length)), `moment ${i}`).toBeGreaterThan(50);
    }
  });

  test('without WebGL, Gaussians that come later appear by their opacity, and the first ones are wider until then', async () => {
    const body = new SkinnedGenerator(baked);
    const { soft } = body;
    const { source } = soft;
    const [rotations, root, residual] = [reference.moments[0]!.rotations, reference.moments[0]!.root, reference.moments[0]!.residual].map((values) => Float64Array.from(values));
    body.pose({ rotations: rotations!, root: root!, residual: residual! });
    const { view, lens } = viewOf(manifest.camera, WIDTH, HEIGHT);
    const first = 100;
    const fainter = new Float32Array(source!.rows.slice(0));
    const stride = fainter.length / source!.count;
    for (let i = first; i < source!.count; i++) fainter[stride * i + 13]! *= 0.5;
    const wider = fainter.slice();
    for (let i = 0; i < first; i++) for (let k = 7; k < 10; k++) wider[stride * i + k]! *= 1.5;
    const draw = async (rows: ArrayBuffer, share: number, wide = 1) => {
      const rasteriser = new Rasteriser(await makeKernel());
      rasteriser.put(0, { ...source!, rows });
      const placed = [{ id: 0, view, drawn: source!.count, values: soft.values, late: { first, share, wide } }];
      return rasteriser.draw({ lens, width: WIDTH, height: HEIGHT, band: [0, WIDTH / TILE_WIDTH], placed }, clothOf([0.5, 0.5, 0.5], WIDTH, HEIGHT)).slice();
    };
    const half = await draw(source!.rows, 0.5);
    expect(worst(half, await draw(fainter.buffer, 1))).toBe(0);
    expect(worst(half, await draw(source!.rows, 1))).toBeGreaterThan(10);
    expect(worst(await draw(source!.rows, 0.5, 1.5), await draw(wider.buffer, 1))).toBe(0);
    expect(soft.late).toEqual({ first: source!.count, share: 0, wide: 1 }); // of one file, all are the first
  });

  test('its texels hold what the file holds', () => {
    const texels = makeTexels(info);
    fillTexels(texels, baked, 0);
    const { words, width, rows, layers } = texels;
    expect({ width, rows, layers }).toEqual({ width: 1024, rows: 1, layers: 6 }); // 96 bytes per Gaussian
    const bytes = new Uint8Array(words.buffer);
    const at = (layer: number, i: number) => 16 * (1024 * layer + i);
    const i = 123;
    expect([...new Float32Array(words.buffer, at(0, i), 3)]).toEqual([...baked.means.subarray(3 * i, 3 * i + 3)]);
    expect([...bytes.subarray(at(0, i) + 12, at(0, i) + 16)]).toEqual([...baked.joints.subarray(4 * i, 4 * i + 4)]);
    expect([...new Int16Array(words.buffer, at(1, i), 4)]).toEqual([...baked.quats.subarray(4 * i, 4 * i + 4)]);
    expect(bytes[at(1, i) + 15]).toBe(baked.opacities[i]);
    const shape = [3, 4, 5].flatMap((layer) => [...new Int8Array(words.buffer, at(layer, i), 16)]);
    expect(shape).toEqual([...baked.shapes.subarray(48 * i, 48 * i + 48)]);
    const halves = new Uint16Array(words.buffer, at(2, i), 8);
    const given = new Uint16Array(read(SKINNED).buffer.slice(...rangeOf('shape_scales', 4 * i, 4)));
    expect([...halves.subarray(6)]).toEqual([...given]);
  });

  test('an older one has no lamp', () => {
    const { num_casters: _, ...older } = info;
    expect(checkManifest({ ...manifest, skinned: older }).skinned!.num_casters).toBe(0);
    expect(readBakedSkinned(tensors(), { ...info, num_casters: 0 }, SKINNED).lamp).toBeNull();
  });

  test('is as long as it was recorded', () => expect(bodyOf(manifest)).toMatchObject({ fps: 15, frames: 31 }));
});

/** Where some bytes of a tensor are in the file's buffer. */
function rangeOf(name: string, begin: number, size: number): [number, number] {
  const file = read(SKINNED);
  const length = Number(file.readBigUInt64LE(0));
  const start = JSON.parse(file.subarray(8, 8 + length).toString())[name].data_offsets[0] as number;
  const from = file.byteOffset + 8 + length + start + begin;
  return [from, from + size];
}

describe('a damaged body on a skeleton is refused in one sentence', () => {
  const spoil = (name: string, change: (tensor: Tensor) => void) => () => {
    const spoiled = tensors();
    change(spoiled.get(name)!);
    readBakedSkinned(spoiled, info, SKINNED);
  };
  const field = (change: object) => () => checkManifest({ ...manifest, skinned: { ...info, ...change } });
  const cases: [string, () => unknown, RegExp][] = [
    ['not finite', spoil('means', ({ data }) => (data[4] = NaN)), /means holds numbers that are not finite/],
    ['endless pose', spoil('roots', ({ data }) => (data[4] = Infinity)), /roots holds numbers/],
    ['a joint that is not there', spoil('joints', ({ data }) => (data[9] = 10)), /joints names one/],
    ['a joint that turns and is not there', spoil('moving', ({ data }) => (data[0] = 200)), /moving names one/],
    ['a frame that is not there', spoil('known', ({ data }) => (data[0] = 31)), /known names one/],
    ['no kernel', spoil('kernel_width', ({ data }) => (data[0] = 0)), /kernel_width/],
    ['a sphere on a joint that is not there', spoil('caster_joints', ({ data }) => (data[9] = 10)), /caster_joints names one/],
    ['a lamp nowhere', spoil('lamp_direction', ({ data }) => data.fill(0)), /lamp_direction/],
    ['a lamp that darkens', spoil('lamp_strength', ({ data }) => (data[1] = -1)), /lamp_strength/],
    ['too many spheres', field({ num_casters: 1e6 }), /num_casters/],
    ['other length', spoil('rotations', (tensor) => tensor.shape[0]!--), /rotations is I16/],
    ['two bodies', () => checkManifest({ ...manifest, body: { fps: 1 } }), /skinned/],
    ['no joints', field({ names: [] }), /skinned.names/],
    ['no tree', field({ parents: info.parents.map(() => 0) }), /skinned.parents/],
    ['two roots', field({ parents: info.parents.map(() => -1) }), /skinned.parents/],
    ['too many shapes', field({ num_shapes: 9 }), /num_shapes/],
    ['too many Gaussians', field({ num_gaussians: 1e9 }), /num_gaussians/],
    ['one frame', field({ num_frames: 1, num_known: 1 }), /num_frames/],
    ['no rate', field({ fps: 0 }), /skinned.fps/],
    ['no box', field({ low: [0, 0] }), /skinned.low/],
  ];
  test.each(cases)('%s', (_, act, sentence) => expect(act).toThrow(sentence));
});
