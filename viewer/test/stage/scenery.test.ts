import { Vector3 } from 'three';
import { describe, expect, test } from 'vitest';
import { Scenery } from '../../src/stage/scenery.ts';

const GREY = [0.5, 0.51, 0.54] as const; // on which the packaged person was trained
const EYES = new Vector3(0, 1.55, 0);
const GROUND = { foot: new Vector3(), up: new Vector3(0, 1, 0), toward: new Vector3(0, 0, 1) };
const CAMERA = new Vector3(0, 1, 4); // sees the whole figure

function room(bright: boolean, feet = true) {
  const scenery = new Scenery(GREY);
  scenery.stand(GROUND, EYES, feet);
  scenery.setBright(bright);
  /** What is seen through a point beside the person, m from the middle of the eyes. */
  const at = (aside: number, down: number): [number, number, number] => {
    const out = new Float32Array(3);
    scenery.colour(CAMERA, new Vector3(aside, EYES.y - down, 0).sub(CAMERA).normalize(), out, 0);
    return [...out] as [number, number, number];
  };
  const luminance = (aside: number, down: number) => at(aside, down).reduce((sum, value, c) => sum + value * [0.2126, 0.7152, 0.0722][c]!, 0);
  return { at, luminance };
}

describe.each([
  ['a dark room', false],
  ['a bright room', true],
])('%s', (_, bright) => {
  test('has the light of a lamp around the head, which falls off at every distance', () => {
    const { luminance } = room(bright);
    const along = [0.1, 0.25, 0.5, 1, 2].map((aside) => luminance(-aside, 0));
    for (const [i, value] of along.slice(1).entries()) expect(along[i]! - value).toBeGreaterThan(0.02);
  });

  test('has the light of a window on the wall to the left of whoever stands there, between bars', () => {
    const { luminance } = room(bright);
    const row = Array.from({ length: 60 }, (_, i) => luminance(0.1 + 0.015 * i, 0.05) - luminance(-0.1 - 0.015 * i, 0.05));
    const bars = row.slice(2).filter((value, i) => row[i + 1]! < value - 1e-6 && row[i + 1]! <= row[i]! && Math.max(...row) - row[i + 1]! > 0.05);
    expect(Math.max(...row)).toBeGreaterThan(0.1);
    expect(bars.length).toBeGreaterThanOrEqual(2);
    expect(row.at(-1)).toBeCloseTo(0, 2);
    const alone = room(bright, false);
    for (let i = 0; i < 60; i++) expect(alone.luminance(0.1 + 0.015 * i, 0.05)).toBeCloseTo(alone.luminance(-0.1 - 0.015 * i, 0.05), 6);
  });

  test('is warm, unlike the cloth before which people are recorded', () => {
    const [red, green, blue] = room(bright).at(0.8, 0.2);
    expect(red).toBeGreaterThan(green);
    expect(green).toBeGreaterThan(blue);
  });

  test('has no ring where the floor becomes the wall', () => {
    const { luminance } = room(bright, false);
    const down = Array.from({ length: 60 }, (_, i) => luminance(1.2, 0.2 + i * 0.03));
    const turns = down.slice(2).filter((value, i) => (value - down[i + 1]!) * (down[i + 1]! - down[i]!) < -1e-8);
    expect(turns.length).toBeLessThan(3); // darker to the horizon, and lighter again before the feet
  });
});

test('a dark room is dark, a bright one bright', () => {
  expect(room(false).luminance(1.5, 0)).toBeLessThan(0.2);
  expect(room(true).luminance(1.5, 0)).toBeGreaterThan(0.65);
});

test('behind a head alone the colour is nearer to that on which it was trained', () => {
  const away = (feet: boolean) => Math.abs(room(false, feet).at(0.1, 0)[1] - GREY[1]);
  expect(away(false)).toBeLessThan(0.06);
  expect(away(true)).toBeGreaterThan(0.08);
});

test('the floor is darkest under each foot that stands on it', () => {
  const scenery = new Scenery(GREY);
  scenery.stand(GROUND, EYES);
  scenery.setBright(true);
  const above = new Vector3(0, 3, 0);
  const light = (aside: number) => {
    const out = new Float32Array(3);
    scenery.colour(above, new Vector3(aside, 0, 0).sub(above).normalize(), out, 0);
    return out[1]!;
  };
  const feet = (...places: [aside: number, height: number][]) =>
    Float32Array.from(places.flatMap(([aside, height]) => [-0.04, 0, 0.04].flatMap((x) => [-0.12, 0, 0.12].flatMap((z) => [aside + x, height, z]))));
  scenery.follow(feet([-0.15, 0.01], [0.15, 0.01]));
  const [left, middle, right] = [-0.15, 0, 0.15].map(light) as [number, number, number];
  expect(left).toBeCloseTo(right, 5);
  expect(left).toBeLessThan(0.8 * middle);
  const before = scenery.version;
  scenery.follow(feet([-0.15, 0.01], [0.15, 0.08]));
  expect(scenery.version).toBeGreaterThan(before);
  expect(light(0.15)).toBeGreaterThan(1.2 * light(-0.15));
});
