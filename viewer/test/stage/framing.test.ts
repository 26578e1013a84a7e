import { Box3, MathUtils, PerspectiveCamera, Vector3 } from 'three';
import { describe, expect, test } from 'vitest';
import type { StartCamera } from '../../src/bundle/manifest.ts';
import { closeUp, figure, portrait, talking, whole } from '../../src/stage/camera/framing.ts';
import type { Sitter } from '../../src/stage/camera/sitter.ts';
import { random } from '../../support/random.ts';

const CHIN = 0.12; // m under the eyes

/** Somebody anywhere, of any build, in a world with any up. */
function someone(next: () => number): Sitter {
  const direction = () => new Vector3(next() - 0.5, next() - 0.5, next() - 0.5).normalize();
  const up = direction();
  const level = direction().projectOnPlane(up).normalize();
  const eyes = direction().multiplyScalar(5 * next());
  return {
    eyes,
    up,
    toward: level.addScaledVector(up, 0.6 * (next() - 0.5)).normalize(),
    crown: 0.09 + 0.16 * next(),
    lowest: 1.6 * next(),
    box: new Box3(eyes.clone().subScalar(1), eyes.clone().addScalar(1)),
  };
}

/** Where a point is on the picture: shares from the left and from above. */
function place(view: StartCamera, aspect: number, point: Vector3): [number, number] {
  const camera = new PerspectiveCamera(view.fov_y, aspect);
  camera.up.set(...view.up);
  camera.position.set(...view.eye);
  camera.lookAt(...view.target);
  camera.updateMatrixWorld();
  const { x, y } = point.clone().project(camera);
  return [(1 + x) / 2, (1 - y) / 2];
}

describe('the first view of somebody', () => {
  const next = random(7);
  const cases = Array.from({ length: 400 }, () => ({
    sitter: someone(next),
    fov: 8 + 50 * next(),
    aspect: 2 ** (4 * next() - 2), // from a quarter to four
    free: 0.4 + 0.6 * next(),
  }));

  test('has the eyes in the middle of the upper third, whatever the shape of the picture', () => {
    for (const { sitter, fov, aspect, free } of cases) {
      const [x, y] = place(portrait(sitter, fov)({ aspect, free }), aspect, sitter.eyes);
      expect(x).toBeCloseTo(0.5, 9);
      expect(y).toBeGreaterThan(0.13);
      expect(y).toBeLessThan(1 / 3);
      if (free > 0.8) expect(y).toBeCloseTo(0.3, 9);
    }
  });

  test('holds all of the head, clear of the controls', () => {
    for (const { sitter, fov, aspect, free } of cases) {
      const view = portrait(sitter, fov)({ aspect, free });
      const upright = sitter.up.clone().projectOnPlane(sitter.toward).normalize();
      const side = upright.clone().cross(sitter.toward);
      const at = (above: number, aside: number) =>
        place(view, aspect, sitter.eyes.clone().addScaledVector(upright, above).addScaledVector(side, aside));
      expect(at(sitter.crown, 0)[1]).toBeGreaterThan(0);
      expect(at(-CHIN, 0)[1]).toBeLessThan(free);
      for (const aside of [-0.1, 0.1]) expect(Math.abs(at(0, aside)[0] - 0.5)).toBeLessThan(0.5);
    }
  });

  const adult: Sitter = {
    eyes: new Vector3(0, 1.55, 0.1),
    toward: new Vector3(0, 0, 1),
    up: new Vector3(0, 1, 0),
    crown: 0.12,
    lowest: 1.55,
    box: new Box3(),
  };
  const height = (sitter: Sitter, aspect: number, free = 0.8) => {
    const { eye, fov_y: fov } = portrait(sitter, 30)({ aspect, free });
    return 2 * sitter.eyes.distanceTo(new Vector3(...eye)) * Math.tan(MathUtils.degToRad(fov) / 2);
  };

  test('shows head and chest on a desktop, and the shoulders on a phone', () => {
    expect(height(adult, 1.6)).toBeCloseTo(0.62, 9);
    expect(height(adult, 1)).toBeCloseTo(0.62, 9);
    expect(height(adult, 390 / 844) * (390 / 844)).toBeCloseTo(0.4, 9);
  });

  test('shows the hands of somebody with a body, which speak before the chest', () => {
    const hands = [0.2, -0.2].map((aside) => new Vector3(aside, 1.55 - 0.36, 0.3));
    for (const aspect of [1.6, 390 / 844]) {
      const view = talking(adult, 30)({ aspect, free: 0.85 });
      const seen = hands.map((hand) => place(view, aspect, hand));
      for (const [x, y] of seen) {
        expect(Math.abs(x - 0.5)).toBeLessThan(0.5);
        expect(y).toBeLessThan(0.85);
      }
      expect(place(view, aspect, adult.eyes)[1]).toBeCloseTo(0.26, 9);
    }
  });

  test('ends where a head alone ends, unless the head would be cut off', () => {
    const edges = (sitter: Sitter) => {
      const view = portrait(sitter, 30)({ aspect: 1.6, free: 0.8 });
      const at = (y: number) => place(view, 1.6, sitter.eyes.clone().add(new Vector3(0, y, 0)))[1];
      return [at(sitter.crown + 0.03), at(-sitter.lowest)];
    };
    const bust = edges({ ...adult, lowest: 0.38 });
    expect(bust[0]).toBeGreaterThan(0);
    expect(bust[1]).toBeCloseTo(1, 9);
    const head = edges({ ...adult, lowest: 0.11 });
    expect(head[0]).toBeCloseTo(0, 9);
    expect(head[1]).toBeLessThan(1);
  });

  test('is level with the eyes of somebody with a body', () => {
    expect(portrait(adult, 30)({ aspect: 1, free: 0.8 }).eye[1]).toBeCloseTo(1.55, 9);
  });
});

describe('the other views of somebody', () => {
  const next = random(8);
  const cases = Array.from({ length: 300 }, () => {
    const sitter = someone(next);
    const level = sitter.toward.clone().projectOnPlane(sitter.up).normalize();
    return { sitter: { ...sitter, toward: level }, fov: 8 + 50 * next(), aspect: 2 ** (4 * next() - 2), free: 0.4 + 0.6 * next() };
  });

  test('the whole figure lies between the upper edge and the controls', () => {
    for (const { sitter, fov, aspect, free } of cases) {
      const view = figure(sitter, fov)({ aspect, free });
      const at = (above: number) => place(view, aspect, sitter.eyes.clone().addScaledVector(sitter.up, above));
      expect(at(sitter.crown)[1]).toBeGreaterThan(0);
      expect(at(-sitter.lowest)[1]).toBeLessThan(free);
      expect(at(0)[0]).toBeCloseTo(0.5, 9);
      const side = sitter.up.clone().cross(sitter.toward).multiplyScalar(0.44);
      expect(place(view, aspect, sitter.eyes.clone().add(side))[0]).toBeLessThan(1);
    }
  });

  test('the whole figure reaches down to the controls of a phone, though captions lie over the legs', () => {
    const [aspect, free, clear] = [390 / 844, 0.6, 0.85];
    for (const { sitter, fov } of cases) {
      const at = (clear?: number) => {
        const view = figure(sitter, fov)({ aspect, free, clear });
        const [crown, feet] = [sitter.crown, -sitter.lowest].map((above) => place(view, aspect, sitter.eyes.clone().addScaledVector(sitter.up, above))[1]);
        return { crown: crown!, feet: feet! };
      };
      const [tall, small] = [at(clear), at()];
      expect(tall.crown).toBeGreaterThan(0);
      expect(tall.feet).toBeLessThan(clear);
      if (sitter.lowest < 1.4) continue; // the arms of a child need the width
      expect(tall.feet).toBeGreaterThan(0.78); // feet near the controls, not in the middle of the picture
      expect(tall.feet - tall.crown).toBeGreaterThan(1.2 * (small.feet - small.crown));
    }
  });

  test('the face is larger than in the first view, and whole', () => {
    for (const { sitter, fov, aspect, free } of cases) {
      const [near, first] = [closeUp, portrait].map((framing) => framing(sitter, fov)({ aspect, free }));
      const distance = (view: StartCamera) => sitter.eyes.distanceTo(new Vector3(...view.eye));
      expect(distance(near!) / distance(first!)).toBeLessThan(sitter.crown < 0.12 && sitter.lowest > 0.5 && free > 0.8 ? 0.9 : 1.2);
      const at = (above: number) => place(near!, aspect, sitter.eyes.clone().addScaledVector(sitter.up, above))[1];
      expect(at(sitter.crown)).toBeGreaterThan(0);
      expect(at(-CHIN)).toBeLessThan(free);
    }
  });
});

describe('the view of a body whose head is nowhere told', () => {
  const camera: StartCamera = { eye: [0, 1, 4], target: [0, 1, 0], up: [0, 1, 0], fov_y: 30 };
  test.each([0.1, 0.3, 0.45, 1, 3])('is the bundle’s own, no narrower than the body, at %d', (aspect) => {
    const view = whole(camera, 0.45)({ aspect, free: 0.7 });
    expect(view).toMatchObject({ eye: camera.eye, target: camera.target, up: camera.up });
    const slopes = [view.fov_y, 30].map((fov) => Math.tan(MathUtils.degToRad(fov) / 2));
    expect(slopes[0]! / slopes[1]!).toBeCloseTo({ 0.1: 4.5, 0.3: 1.5 }[aspect] ?? 1, 9);
  });
});
