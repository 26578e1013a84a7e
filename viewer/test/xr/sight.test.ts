import { Vector3 } from 'three';
import { describe, expect, test } from 'vitest';
import { Rig } from '../../src/xr/rig.ts';
import { Sight } from '../../src/xr/sight.ts';

const UP = new Vector3(0, 1, 0);
const CHIN = new Vector3(0, 1.46, 0);
const HEAD = new Vector3(0.3, 1.6, 0.2); // of the visitor, in the headset's space
const AHEAD = new Vector3(0, 0, -1);
const EDGE = 0.42; // rad aside: with its half width of 17°, the board ends within the 45° that headsets show
const DEGREE = Math.PI / 180;

/** A visitor before somebody, and the place of the board as the visitor has it. */
function meeting() {
  const rig = new Rig({ foot: new Vector3(), up: UP, toward: new Vector3(0, 0, 1) }, CHIN);
  const sight = new Sight();
  rig.meet(HEAD.clone().addScaledVector(AHEAD, 1.2), HEAD);
  const pass = (look = AHEAD, step = 0.01) => {
    sight.pass(step, rig.aside(HEAD, look));
    const visitor = rig.localToWorld(HEAD.clone());
    const place = sight.nearest(CHIN.clone(), visitor, UP);
    const seen = rig.worldToLocal(place.clone()).sub(HEAD);
    return { place, aside: look.clone().cross(seen).y > 0 ? flat(look, seen) : -flat(look, seen), far: place.distanceTo(visitor), visitor };
  };
  return { rig, sight, pass };
}

const flat = (a: Vector3, b: Vector3) => a.clone().setY(0).angleTo(b.clone().setY(0));
const turned = (degrees: number) => AHEAD.clone().applyAxisAngle(UP, degrees * DEGREE);

describe('the board', () => {
  test('is below the face while the visitor only looks around', () => {
    const { pass } = meeting();
    for (const degrees of [0, 20, 40, -40]) expect(pass(turned(degrees)).place.distanceTo(CHIN)).toBe(0);
  });

  test.each([30, -30, 45, -60, 90])('is in sight at once after a turn of %i°, as near to the face as that allows', (degrees) => {
    const { rig, sight, pass } = meeting();
    pass();
    rig.turn(degrees * DEGREE, HEAD);
    sight.carry();
    const { aside, far, visitor } = pass();
    expect(Math.abs(aside)).toBeLessThan(EDGE);
    expect(Math.sign(aside)).toBe(-Math.sign(degrees)); // towards the face
    expect(far).toBeCloseTo(CHIN.distanceTo(visitor), 9);
  });

  test('is in sight at once after a teleport that leaves the face aside', () => {
    const { rig, sight, pass } = meeting();
    pass();
    rig.go(new Vector3(-0.9, 0, 1.2), HEAD, AHEAD);
    sight.carry();
    expect(Math.abs(rig.aside(HEAD, AHEAD))).toBeGreaterThan(30 * DEGREE);
    expect(Math.abs(pass().aside)).toBeLessThan(EDGE);
  });

  test('comes back to the face without a jump when the visitor looks there, and stays', () => {
    const { rig, sight, pass } = meeting();
    rig.turn(45 * DEGREE, HEAD);
    sight.carry();
    const places = Array.from({ length: 46 }, (_, i) => pass(turned(-i)).place);
    const steps = places.slice(1).map((place, i) => place.distanceTo(places[i]!));
    expect(Math.max(...steps)).toBeLessThan(0.04); // a degree at 1.2 m is 0.02
    expect(places.at(-1)!.distanceTo(CHIN)).toBe(0);
    expect(pass(turned(0)).place.distanceTo(CHIN)).toBe(0); // eyes go away by themselves
  });
});

test('whoever has not seen somebody for a while is lost', () => {
  const { pass, sight } = meeting();
  pass(turned(60), 1);
  expect(sight.isLost).toBe(false);
  pass(turned(60), 1);
  expect(sight.isLost).toBe(true);
  pass(turned(10), 1);
  expect(sight.isLost).toBe(false);
});
