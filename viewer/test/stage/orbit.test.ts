import { Box3, MathUtils, Plane, Raycaster, Vector2, Vector3 } from 'three';
import { describe, expect, test } from 'vitest';
import type { StartCamera } from '../../src/bundle/manifest.ts';
import { boundsOf, boundsOfBody } from '../../src/stage/camera/bounds.ts';
import { closeUp, figure, portrait, whole } from '../../src/stage/camera/framing.ts';
import { Orbit, type Subject } from '../../src/stage/camera/orbit.ts';
import type { Sitter } from '../../src/stage/camera/sitter.ts';
import { FakeCanvas } from '../../support/doubles/canvas.ts';
import { random } from '../../support/random.ts';

const [WIDTH, HEIGHT] = [900, 600];
const OVERVIEW: StartCamera = { eye: [0, 0.8, 4.3], target: [0, 0.8, 0], up: [0, 1, 0], fov_y: 30 };
const SITTER: Sitter = {
  eyes: new Vector3(0.01, 1.5, 0.1),
  toward: new Vector3(0, 0, 1),
  up: new Vector3(0, 1, 0),
  crown: 0.12,
  lowest: 1.5,
  box: new Box3(new Vector3(-0.3, 0, -0.15), new Vector3(0.3, 1.6, 0.4)),
};
const PERSON: Subject = {
  up: [0, 1, 0],
  framings: { face: closeUp(SITTER, 30), half: portrait(SITTER, 30), whole: figure(SITTER, 30) },
  home: 'half',
  bounds: (start) => boundsOf(SITTER, start, OVERVIEW),
  sideways: Infinity,
  face: SITTER.eyes,
};

/** A visitor before somebody, and where things are for them. */
class Visit {
  readonly canvas: FakeCanvas;
  readonly orbit: Orbit;

  constructor(subject = PERSON, width = WIDTH, height = HEIGHT) {
    this.canvas = new FakeCanvas(width, height);
    this.orbit = new Orbit(this.canvas.element, subject, () => {});
    this.orbit.fit({ aspect: width / height, free: 0.8 });
  }

  /** Where a point is, pixels. */
  pixel(point: Vector3): [number, number] {
    this.orbit.camera.updateMatrixWorld();
    const { x, y } = point.clone().project(this.orbit.camera);
    return [((1 + x) * this.canvas.clientWidth) / 2, ((1 - y) * this.canvas.clientHeight) / 2];
  }

  /** What is under a pixel, in the plane of the face. */
  under(x: number, y: number): Vector3 {
    const { camera } = this.orbit;
    camera.updateMatrixWorld();
    const ray = new Raycaster();
    ray.setFromCamera(new Vector2((2 * x) / this.canvas.clientWidth - 1, 1 - (2 * y) / this.canvas.clientHeight), camera);
    const plane = new Plane().setFromNormalAndCoplanarPoint(new Vector3(0, 0, 1), SITTER.eyes);
    return ray.ray.intersectPlane(plane, new Vector3())!;
  }

  /** Whether a point is in the picture, above the controls. */
  shown(point: Vector3): boolean {
    const [x, y] = this.pixel(point);
    const { clientWidth, clientHeight } = this.canvas;
    return x > 0 && x < clientWidth && y > 0 && y < 0.8 * clientHeight;
  }

  /** Until nothing glides any more. */
  settle(): void {
    for (let i = 0; i < 400; i++) this.orbit.update(1 / 60);
  }

  /** How many pixels an upright 10 cm at the face are long. */
  get size(): number {
    const [, low] = this.pixel(SITTER.eyes.clone().add(new Vector3(0, -0.05, 0)));
    const [, high] = this.pixel(SITTER.eyes.clone().add(new Vector3(0, 0.05, 0)));
    return low - high;
  }
}

const apart = ([x, y]: [number, number], [u, v]: [number, number]) => Math.hypot(x - u, y - v);

describe('zooming', () => {
  test.each([
    [450, 180],
    [500, 300],
    [380, 120],
    [430, 305],
  ])('with the wheel, what is under the pointer at %d, %d stays there', (x, y) => {
    const visit = new Visit();
    const [point, before] = [visit.under(x, y), visit.size];
    for (let notch = 0; notch < 6; notch++) {
      visit.canvas.wheel(x, y, -1);
      visit.orbit.update();
      expect(apart(visit.pixel(point), [x, y])).toBeLessThan(1e-6);
    }
    expect(visit.size / before / Math.exp(0.6)).toBeCloseTo(1, 1);
    for (let notch = 0; notch < 6; notch++) visit.canvas.wheel(x, y, 1);
    expect(apart(visit.pixel(point), [x, y])).toBeLessThan(1e-6);
    expect(visit.size / before).toBeCloseTo(1, 9);
  });

  test('with the wheel on the face, the face gets as large as the picture and no larger', () => {
    const visit = new Visit();
    const face = visit.pixel(SITTER.eyes);
    for (let notch = 0; notch < 60; notch++) visit.canvas.wheel(...face, -1);
    expect(apart(visit.pixel(SITTER.eyes), face)).toBeLessThan(1e-6);
    expect((visit.size / HEIGHT) * 2.2).toBeGreaterThan(1); // 22 cm from chin to crown
    expect(visit.orbit.camera.position.distanceTo(SITTER.eyes)).toBeGreaterThan(0.3);
  });

  test('then going around goes around what was zoomed at', () => {
    const visit = new Visit();
    const face = visit.pixel(SITTER.eyes);
    for (let notch = 0; notch < 60; notch++) visit.canvas.wheel(...face, -1);
    visit.canvas.drag(100, 0);
    visit.settle();
    const { position } = visit.orbit.camera;
    expect(Math.abs(position.x - SITTER.eyes.x)).toBeGreaterThan(0.25);
    expect(position.distanceTo(SITTER.eyes)).toBeLessThan(0.4);
    expect(apart(visit.pixel(SITTER.eyes), face)).toBeLessThan(HEIGHT / 6);
  });

  test('with two fingers, what is between them stays between them and grows as they part', () => {
    const visit = new Visit(PERSON, 390, 844);
    const between: [number, number] = [210, 300];
    const [point, before] = [visit.under(...between), visit.size];
    visit.canvas.pinch([[180, 300], [240, 300]], [[150, 300], [270, 300]]);
    visit.settle();
    expect(apart(visit.pixel(point), between)).toBeLessThan(1e-6);
    expect(visit.size / before).toBeCloseTo(2, 1);
  });

  test('with two fingers that also wander, she wanders along', () => {
    const visit = new Visit(PERSON, 390, 844);
    const point = visit.under(200, 300);
    visit.canvas.pinch([[170, 300], [230, 300]], [[170, 340], [270, 340]]);
    visit.settle();
    expect(apart(visit.pixel(point), [220, 340])).toBeLessThan(1);
  });

  test('with + and −, the face keeps its place in the picture', () => {
    const visit = new Visit();
    const [face, before] = [visit.pixel(SITTER.eyes), visit.size];
    for (let i = 0; i < 5; i++) visit.canvas.press('+');
    expect(visit.size / before).toBeCloseTo(1.08 ** 5, 2);
    expect(apart(visit.pixel(SITTER.eyes), face)).toBeLessThan(1e-6);
    for (let i = 0; i < 40; i++) visit.canvas.press('+');
    expect(apart(visit.pixel(SITTER.eyes), face)).toBeLessThan(1e-6);
    for (let i = 0; i < 5; i++) visit.canvas.press('-');
    expect(apart(visit.pixel(SITTER.eyes), face)).toBeLessThan(1e-6);
    visit.canvas.press('Home');
    visit.settle();
    expect(visit.size).toBeCloseTo(before, 6);
  });
});

describe('flying to another view', () => {
  test('goes there smoothly, without coming near the head, from behind, too', () => {
    const visit = new Visit();
    const { camera } = visit.orbit;
    for (const [view, turn] of [['whole', 0], ['face', 0], ['half', 700]] as const) {
      if (turn) visit.canvas.drag(turn, 0);
      visit.settle();
      const end = new Vector3(...PERSON.framings[view]!({ aspect: WIDTH / HEIGHT, free: 0.8 }).eye);
      const [start, steps] = [camera.position.clone(), [] as number[]];
      visit.orbit.show(view);
      expect(visit.orbit.view).toBe(view);
      for (let i = 0; i < 60; i++) {
        const before = camera.position.clone();
        visit.orbit.update(1 / 60);
        steps.push(before.distanceTo(camera.position));
        expect(camera.position.distanceTo(SITTER.eyes)).toBeGreaterThan(0.3);
      }
      expect(camera.position.distanceTo(end)).toBeLessThan(1e-6);
      const way = start.distanceTo(end);
      expect(way).toBeGreaterThan(0.4);
      expect(Math.max(...steps)).toBeLessThan(0.1 * Math.max(way, steps.reduce((sum, step) => sum + step, 0)));
      for (const i of [0, 53]) expect(steps[i]).toBeLessThan(0.01 * way); // at rest when it starts and ends
    }
  });

  test('ends where it is when the visitor does something, and jumps for who wants little motion', () => {
    const visit = new Visit();
    visit.orbit.show('whole');
    for (let i = 0; i < 20; i++) visit.orbit.update(1 / 60);
    visit.canvas.wheel(450, 300, -1);
    expect(visit.orbit.view).toBe(null);
    const { position } = visit.orbit.camera;
    visit.settle();
    const before = position.clone();
    visit.settle();
    expect(position.distanceTo(before)).toBeLessThan(1e-9);
    expect(position.distanceTo(SITTER.eyes)).toBeLessThan(4);
    const { matchMedia } = globalThis;
    globalThis.matchMedia = () => ({ matches: true }) as MediaQueryList;
    visit.orbit.show('face');
    globalThis.matchMedia = matchMedia;
    const { eye } = PERSON.framings.face!({ aspect: WIDTH / HEIGHT, free: 0.8 });
    expect(position.distanceTo(new Vector3(...eye))).toBeLessThan(1e-9);
  });

  test('a double click flies to what is under the pointer, one beside everybody goes back', () => {
    const visit = new Visit();
    visit.orbit.show('whole');
    visit.settle();
    const hand = visit.pixel(new Vector3(0.2, 0.9, 0.1));
    const before = visit.size;
    visit.canvas.doubleClick(...hand);
    visit.settle();
    expect(visit.size / before).toBeGreaterThan(1.7);
    expect(Math.abs(visit.pixel(new Vector3(0.2, 0.9, 0))[0] - WIDTH / 2)).toBeLessThan(40);
    expect(visit.pixel(new Vector3(0.2, 0.9, 0))[1]).toBeLessThan(HEIGHT);
    expect(visit.shown(SITTER.eyes)).toBe(true);
    expect(visit.orbit.view).toBe(null);
    visit.canvas.doubleClick(5, 5);
    visit.settle();
    expect(visit.orbit.view).toBe('half');
    expect(visit.size).toBeCloseTo(new Visit().size, 3);
  });
});

test('dragging goes all around somebody with a body', () => {
  const visit = new Visit();
  const seen = Array.from({ length: 8 }, () => {
    visit.canvas.drag(HEIGHT / 8, 0);
    visit.settle();
    const { x, z } = visit.orbit.camera.position;
    return Math.round(MathUtils.radToDeg(Math.atan2(x - SITTER.eyes.x, z - SITTER.eyes.z)));
  });
  expect(seen.map(Math.abs)).toEqual([45, 90, 135, 180, 135, 90, 45, 0]);
});

describe('zooming beside her', () => {
  test('with a double click on what is behind her head goes back; from afar the face stays above the controls', () => {
    const visit = new Visit(PERSON, 1440, 900);
    visit.canvas.doubleClick(250, 200);
    visit.settle();
    expect(visit.orbit.view).toBe('half');
    for (let notch = 0; notch < 60; notch++) visit.canvas.wheel(720, 450, 1);
    for (const [x, y] of [[700, 700], [650, 650], [800, 500]] as const) {
      visit.canvas.doubleClick(x, y);
      visit.settle();
      expect(visit.shown(SITTER.eyes)).toBe(true);
    }
  });

  test('with two fingers on the legs leaves the face in the picture', () => {
    const visit = new Visit(PERSON, 844, 390);
    visit.orbit.show('whole');
    visit.settle();
    visit.canvas.pinch([[400, 250], [440, 250]], [[300, 250], [540, 250]]);
    visit.settle();
    expect(visit.shown(SITTER.eyes)).toBe(true);
  });
});

describe('wherever a visitor goes', () => {
  const body: Subject = {
    up: [0, 1, 0],
    framings: { whole: whole(OVERVIEW, 0.45) },
    home: 'whole',
    bounds: () => boundsOfBody(SITTER.box, OVERVIEW),
    sideways: Infinity,
    face: null,
  };
  test.each([
    ['a person', PERSON, 1],
    ['a person on a phone', PERSON, 2],
    ['a body', body, 3],
  ] as const)('the camera of %s is never inside, never far, and some of them is in the picture', (_, subject, seed) => {
    const phone = seed === 2;
    const [width, height] = phone ? [390, 844] : [WIDTH, HEIGHT];
    const visit = new Visit(subject, width, height);
    const next = random(seed);
    const skin = new Box3(new Vector3(-0.3, 0, -0.15), new Vector3(0.3, 1.36, 0.4)); // under the chin
    const any = () => [next() * width, next() * height] as const;
    for (let step = 0; step < 600; step++) {
      const chance = next();
      if (chance < 0.4) visit.canvas.wheel(...any(), next() < 0.7 ? -1 : 1);
      else if (chance < 0.45) visit.canvas.doubleClick(...any());
      else if (chance < 0.5) visit.orbit.show((['face', 'half', 'whole'] as const)[Math.floor(3 * next())]!);
      else if (chance < 0.7) visit.canvas.drag(300 * (next() - 0.5), 300 * (next() - 0.5));
      else visit.canvas.press(['ArrowUp', 'ArrowDown', 'ArrowLeft', '+', '-'][Math.floor(5 * next())]!);
      visit.orbit.update(0.1);
      const { position } = visit.orbit.camera;
      expect(skin.distanceToPoint(position)).toBeGreaterThan(0);
      expect(position.distanceTo(SITTER.eyes)).toBeGreaterThan(0.25);
      expect(position.length()).toBeLessThan(12);
      const pixels = Array.from({ length: 31 }, (_, i) => visit.pixel(new Vector3(0, i / 20, 0.05)));
      const nearest = Math.min(...pixels.map(([x, y]) => Math.max(-x, x - width, -y, y - height)));
      expect(nearest).toBeLessThan(0.1 * Math.max(width, height));
      if (subject.face && visit.orbit.view === null) expect(visit.shown(SITTER.eyes)).toBe(true);
    }
    visit.canvas.press('Home');
    visit.settle();
    const start = subject.framings[subject.home]!({ aspect: width / height, free: 0.8 });
    expect(visit.orbit.camera.position.distanceTo(new Vector3(...start.eye))).toBeLessThan(1e-6);
  });
});

describe('a picture of another shape', () => {
  const shapes = [[1280, 800], [390, 844], [844, 390], [600, 600]] as const;

  test('is framed anew while nobody moved the camera', () => {
    const visit = new Visit();
    for (const [width, height] of shapes) {
      const picture = { aspect: width / height, free: 0.7 };
      visit.orbit.fit(picture);
      for (let i = 0; i < 5; i++) visit.orbit.update();
      const { eye } = PERSON.framings.half!(picture);
      expect(visit.orbit.camera.position.distanceTo(new Vector3(...eye))).toBeLessThan(1e-9);
    }
  });

  test.each([
    ['the wheel', (canvas: FakeCanvas) => canvas.wheel(400, 300, -1)],
    ['a key', (canvas: FakeCanvas) => canvas.press('ArrowLeft')],
    ['the mouse', (canvas: FakeCanvas) => canvas.drag(50, 0)],
  ])('leaves the camera where the visitor put it with %s, until Home', (_, move) => {
    const visit = new Visit();
    move(visit.canvas);
    visit.settle();
    const before = visit.orbit.camera.position.clone();
    visit.orbit.fit({ aspect: 390 / 844, free: 0.7 });
    visit.settle();
    expect(visit.orbit.camera.position.distanceTo(before)).toBeLessThan(1e-6);
    visit.canvas.press('Home');
    visit.settle();
    expect(MathUtils.radToDeg(visit.orbit.camera.rotation.y)).toBeCloseTo(0, 6);
    visit.orbit.fit({ aspect: 1, free: 0.8 });
    const { eye } = PERSON.framings.half!({ aspect: 1, free: 0.8 });
    expect(visit.orbit.camera.position.distanceTo(new Vector3(...eye))).toBeLessThan(1e-9);
  });

  test('a tap does not count as moving', () => {
    const visit = new Visit();
    visit.canvas.drag(0, 0);
    visit.orbit.fit({ aspect: 0.5, free: 0.8 });
    const { eye } = PERSON.framings.half!({ aspect: 0.5, free: 0.8 });
    expect(visit.orbit.camera.position.distanceTo(new Vector3(...eye))).toBeLessThan(1e-9);
  });
});

test('a camera at rest stays where it is to the last digit, or every picture would be of another view', () => {
  const visit = new Visit();
  const numbers = () => [...visit.orbit.camera.position.toArray(), ...visit.orbit.camera.quaternion.toArray()];
  for (const aside of [37, -61, 90]) {
    visit.canvas.drag(aside, 0);
    const dragged = numbers();
    visit.settle();
    const before = numbers();
    expect(before).not.toEqual(dragged); // what was turned ran out
    for (let i = 0; i < 200; i++) visit.orbit.update(1 / 60);
    expect(numbers()).toEqual(before);
  }
});
