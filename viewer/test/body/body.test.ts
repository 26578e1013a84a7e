import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { describe, expect, test } from 'vitest';
import { capacityOf, coefficientPlaces, pack } from '../../src/body/packed.ts';
import { SortWatch } from '../../src/body/sorting.ts';
import { Timeline } from '../../src/body/timeline.ts';
import { coefficientsAt, readBakedWindow } from '../../src/body/window.ts';
import { checkManifest } from '../../src/bundle/manifest.ts';
import { parseSafetensors, type Tensor } from '../../src/bundle/safetensors.ts';
import { Playback } from '../../src/motion/playback.ts';
import { label } from '../../src/ui/player.ts';
import { makeBody } from '../../support/references/body.ts';
import { arrayBuffer } from '../../support/references/head.ts';

const TIMES = [0, 0.013, 0.31, 1, 1.01, 1.7, 2.98, 3];
const reference = makeBody({ gaussians: 600, times: TIMES });
const read = (name: string) => readFileSync(join(reference.folder, name));
const manifest = checkManifest(JSON.parse(read('manifest.json').toString()));
const body = manifest.body!;
const tensors = (window: number) => parseSafetensors(arrayBuffer(read(body.windows[window]!.file)), 'body');
const parse = (window: number) => readBakedWindow(tensors(window), body, body.windows[window]!);

describe('a body that Python baked', () => {
  test('its coefficients are those of the Python evaluator at any time', () => {
    for (const { window, tau, coefficients } of reference.moments) {
      const { curve } = parse(window);
      const out = new Float32Array(curve.size);
      coefficientsAt(curve, tau, out);
      const largest = Math.max(...curve.rows.map(Math.abs));
      coefficients.forEach((value, k) => expect(Math.abs(out[k]! - value)).toBeLessThan(1e-6 * largest));
    }
  });

  test('its centres follow from the packed textures and the coefficients', () => {
    const capacity = capacityOf(body);
    const layer = 4 * capacity.width * capacity.rows;
    for (const { window, tau, centres } of reference.moments) {
      const packed = pack(parse(window), capacity);
      const c = new Float32Array(packed.curve.size);
      coefficientsAt(packed.curve, tau, c);
      const places = coefficientPlaces(packed.window, capacity);
      for (let i = 0; i < 3 * packed.window.num_gaussians; i++) {
        const texel = 4 * Math.floor(i / 3) + (i % 3);
        const cluster = packed.rest[texel - (i % 3) + 3]!;
        let value = packed.rest[texel]!;
        for (let k = 0; k < packed.window.ranks[0]; k++) {
          const at = cluster * (7 + 5 + 2) + k;
          value += c[at]! * packed.basis[(1 + (places[at]! % 16)) * layer + texel]!;
        }
        expect(Math.abs(value - centres[i]!)).toBeLessThan(1e-5);
      }
    }
  });

  test('smaller windows fit into the capacity, what they leave free is 0', () => {
    const capacity = capacityOf(body);
    expect(capacity).toMatchObject({ count: 600, width: 1024, rows: 1, clusters: 4, ranks: [7, 5, 2] });
    const packed = pack(parse(2), { ...capacity, ranks: [9, 6, 4] });
    expect(packed.window.num_gaussians).toBe(580);
    expect(packed.rest.subarray(4 * 580, 4 * 1024).every((value) => value === 0)).toBe(true);
    expect(packed.basis.length).toBe(4 * 1024 * 20);
    const places = coefficientPlaces(packed.window, { ...capacity, ranks: [9, 6, 4] });
    const row = [0, 1, 2, 3, 4, 5, 6, 9, 10, 11, 12, 13, 15, 16];
    expect(places).toEqual([0, 1, 2, 3].flatMap((cluster) => row.map((place) => 20 * cluster + place)));
    expect(packed.colours.subarray(0, 4 * 580)).toEqual(parse(2).rgba);
    expect(packed.basis.subarray(0, 4 * 580)).toEqual(parse(2).quats);
  });
});

describe('a damaged body is refused in one sentence', () => {
  const spoil = (name: string, change: (tensor: Tensor) => void) => () => {
    const spoiled = tensors(0);
    change(spoiled.get(name)!);
    readBakedWindow(spoiled, body, body.windows[0]!);
  };
  const window = (change: object) => () => {
    const windows = [{ ...body.windows[0]!, ...change }, ...body.windows.slice(1)];
    return checkManifest({ ...manifest, body: { ...body, windows } });
  };
  const cases: [string, () => unknown, RegExp][] = [
    ['not finite', spoil('means', ({ data }) => (data[4] = NaN)), /means holds numbers that are not finite/],
    ['endless coefficient', spoil('coefficients', ({ data }) => (data[1] = Infinity)), /coefficients holds numbers/],
    ['other counts', () => readBakedWindow(tensors(0), body, body.windows[1]!), /clusters is U8 .* should be/],
    ['other length', spoil('coefficients', (tensor) => tensor.shape[0]!--), /coefficients is F32/],
    ['no head, no body', () => checkManifest({ ...manifest, body: null }), /head is missing/],
    ['no windows', () => checkManifest({ ...manifest, body: { ...body, windows: [] } }), /body.windows/],
    ['a cluster that is not there', spoil('clusters', ({ data }) => (data[9] = 200)), /clusters names one/],
    ['no clusters', window({ num_clusters: 0 }), /num_clusters/],
    ['no rate', () => checkManifest({ ...manifest, body: { ...body, fps: 0 } }), /body.fps/],
    ['a file elsewhere', window({ file: 'https://elsewhere.example/track' }), /body.windows\[0\].file/],
    ['a file above the folder', window({ file: '../admin' }), /body.windows\[0\].file/],
    ["another window's file", window({ file: 'body/0001.safetensors' }), /body.windows\[0\].file/],
    ['a gap', window({ first: 1 }), /body.windows\[0\]/],
    ['an endless window', window({ last: Infinity }), /body.windows\[0\]/],
    ['no Gaussians', window({ num_gaussians: 0 }), /num_gaussians/],
    ['too many', window({ num_gaussians: 1e9 }), /num_gaussians/],
    ['too many layers', window({ ranks: [200, 3, 2] }), /ranks/],
    ['half a rank', window({ ranks: [0.5, 3, 2] }), /ranks/],
  ];
  test.each(cases)('%s', (_, act, sentence) => expect(act).toThrow(sentence));
});

test('a head of before bodies is read as one without a body', () => {
  const { body: _, ...older } = manifest;
  const head = { ...manifest, num_gaussians: 1, rank: 1, hidden: 1, expression_size: 1, num_poses: 1, fps: 1, idle_expression: [0] };
  expect(checkManifest({ ...older, version: 1, head }).body).toBeNull();
});

describe('the time line', () => {
  const timeline = new Timeline({ fps: 10, windows: [4, 10, 12].map((last) => ({ last })) as typeof body.windows });

  test('knows the window of a time, at a border the earlier one', () => {
    const found = [-1, 0, 0.2, 0.4, 0.41, 1, 1.1, 1.2, 9].map((time) => timeline.windowAt(time));
    expect(found).toEqual([0, 0, 0, 0, 1, 1, 2, 2, 2]);
    expect(timeline.duration).toBeCloseTo(1.2);
    expect([timeline.contains(0, 0.4), timeline.contains(1, 0.4), timeline.contains(2, 0.4)]).toEqual([true, true, false]);
  });

  test('knows the windows on the way from stop to stop', () => {
    expect([0, 1, 2].map((window) => timeline.route(window, [1.2, 0], 2))).toEqual([[1, 2], [2, 1], [1, 0]]);
    expect([0, 1, 2].map((window) => timeline.route(window, [0, 1.2], 2))).toEqual([[1, 2], [0, 1], [1, 0]]);
    expect(timeline.route(0, [0.4, 0.1, 0.5, 0.4, 1.1], 9)).toEqual([1, 2]); // a border belongs to both
    expect(timeline.route(2, [0.2, 0.3], 9)).toEqual([1, 0]);
    expect(timeline.route(1, [], 2)).toEqual([]);
    expect([0, 1, 2].map((window) => timeline.beside(window))).toEqual([[1], [2, 0], [1]]);
  });

  test('places a time in its window', () => {
    expect(timeline.tau(1, 0.7)).toBeCloseTo(0.5);
    expect(timeline.clamp(1, 0.1)).toBeCloseTo(0.4);
    expect(timeline.clamp(1, 3)).toBeCloseTo(1);
  });
});

test('playback turns around at both ends without a jump', () => {
  const playback = new Playback(1, true);
  const prompt = { time: 0, waiting: false };
  const seen = Array.from({ length: 60 }, () => {
    playback.advance(0.07, prompt);
    return playback.time;
  });
  expect(Math.max(...seen)).toBeGreaterThan(0.95);
  expect(Math.min(...seen.slice(15))).toBeLessThan(0.05);
  for (let i = 1; i < seen.length; i++) expect(Math.abs(seen[i]! - seen[i - 1]!)).toBeLessThanOrEqual(0.07 + 1e-9);
  playback.seek(7);
  expect(playback.time).toBe(1);
  playback.playing = false;
  playback.advance(1, prompt);
  expect(playback.time).toBe(1);
  playback.playing = true;
  playback.advance(100.5, prompt);
  expect(playback.time).toBe(0.75);
  playback.advance(0.1, { time: 0.75, waiting: true });
  expect(playback.time).toBe(0.75);
});

describe('a change has been sorted', () => {
  const sorter = { sorting: false, lastSortTime: 0 };
  const begin = (at: number) => Object.assign(sorter, { sorting: true, lastSortTime: at });
  const end = () => (sorter.sorting = false);

  test('when a sort that began after it was drawn has ended', () => {
    const watch = new SortWatch(sorter);
    expect(watch.settled()).toBe(true);
    begin(5);
    watch.changed();
    watch.drawing(10);
    expect(watch.settled()).toBe(false); // the sort that runs began before
    end();
    watch.drawing(11);
    expect(watch.settled()).toBe(false);
    begin(10);
    expect(watch.settled()).toBe(false);
    end();
    expect(watch.settled()).toBe(true);
    begin(20);
    expect(watch.settled()).toBe(true); // and stays so
  });

  test('also when the next sort began before anybody looked', () => {
    const watch = new SortWatch(sorter);
    watch.changed();
    watch.drawing(30);
    begin(31);
    expect(watch.settled()).toBe(false);
    end();
    begin(40);
    expect(watch.settled()).toBe(true);
  });

  test('also when sort follows sort while nobody asks', () => {
    const watch = new SortWatch(sorter);
    watch.changed();
    watch.drawing(41);
    begin(42);
    watch.drawing(43);
    begin(44);
    watch.drawing(45);
    begin(46);
    expect(watch.settled()).toBe(true);
  });

  test('how long it took is kept for a while', () => {
    let now = 0;
    const watch = new SortWatch(sorter, () => now);
    expect(watch.took).toBe(Infinity);
    const sort = (from: number, until: number) => {
      end();
      watch.changed();
      watch.drawing(from);
      begin(from);
      end();
      now = until;
      watch.drawing(until);
    };
    sort(100, 150);
    expect(watch.took).toBe(50);
    sort(200, 210);
    expect(watch.took).toBe(40);
    sort(300, 390);
    expect(watch.took).toBe(90);
  });

  test('not before it was drawn', () => {
    const watch = new SortWatch(sorter);
    begin(50);
    end();
    watch.changed();
    expect(watch.settled()).toBe(false);
  });
});

test('times are read as minutes and seconds', () => {
  expect([0, 3.25, 59.96, 65.3, 600].map(label)).toEqual(['0:00.0', '0:03.3', '1:00.0', '1:05.3', '10:00.0']);
});
