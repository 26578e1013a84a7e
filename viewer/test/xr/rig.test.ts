import { Quaternion, Vector3 } from 'three';
import { describe, expect, test } from 'vitest';
import type { Ground } from '../../src/stage/camera/ground.ts';
import { Rig } from '../../src/xr/rig.ts';
import { random } from '../../support/random.ts';

const next = random(5);
const vector = (size: number) => new Vector3(next() - 0.5, next() - 0.5, next() - 0.5).multiplyScalar(2 * size);

/** Somebody anywhere in a world with any up, and a visitor anywhere in their own room. */
const cases = Array.from({ length: 50 }, () => {
  const up = vector(1).normalize();
  const toward = vector(1).projectOnPlane(up).normalize();
  const ground: Ground = { foot: vector(3), up, toward };
  const eyes = ground.foot.clone().addScaledVector(up, 1.6).addScaledVector(toward, 0.1);
  return { ground, eyes, rig: new Rig(ground, eyes), head: vector(2).setY(1 + next()), spot: vector(2).setY(0) };
});

/** How far a point of the world is above the floor. */
const height = (point: Vector3, { foot, up }: Ground) => point.clone().sub(foot).dot(up);

/** Where somebody looks who looks at a spot on the floor, level. */
const ahead = (head: Vector3, spot: Vector3) => spot.clone().sub(head).setY(0).normalize();

const close = (a: Vector3, b: Vector3) => expect(a.distanceTo(b)).toBeLessThan(1e-9);

describe('the space of a headset', () => {
  test('is as large as the world, its floor on the floor', () => {
    for (const { ground, eyes, rig, head, spot } of cases) {
      rig.meet(spot, head);
      const world = rig.localToWorld(head.clone());
      expect(height(world, ground)).toBeCloseTo(head.y, 9);
      const apart = world.clone().sub(eyes).projectOnPlane(ground.up).length();
      expect(apart).toBeCloseTo(head.clone().sub(spot).setY(0).length(), 9);
    }
  });

  test('has the person where they are asked to stand, turned to the visitor', () => {
    for (const { ground, eyes, rig, head, spot } of cases) {
      rig.meet(spot, head);
      const place = rig.localToWorld(spot.clone());
      close(place, eyes.clone().addScaledVector(ground.up, -1.6));
      const way = rig.localToWorld(head.clone()).sub(place).projectOnPlane(ground.up).normalize();
      close(way, ground.toward);
    }
  });

  test('goes along to a place on the floor, turned as before', () => {
    for (const { ground, eyes, rig, head, spot } of cases) {
      rig.meet(spot, head);
      const turned = rig.quaternion.clone();
      const goal = eyes.clone().addScaledVector(ground.toward, 3).add(vector(1));
      rig.go(goal, head, ahead(head, spot));
      const world = rig.localToWorld(head.clone());
      expect(world.sub(goal).projectOnPlane(ground.up).length()).toBeLessThan(1e-9);
      expect(height(rig.position, ground)).toBeCloseTo(0, 9);
      expect(rig.quaternion.angleTo(turned)).toBeLessThan(1e-6);
    }
  });

  test('who went past somebody is turned to them, and stays there', () => {
    for (const { ground, eyes, rig, head, spot } of cases) {
      rig.meet(spot, head);
      const look = ahead(head, spot);
      expect(rig.aside(head, look)).toBeCloseTo(0, 6);
      const goal = eyes.clone().addScaledVector(ground.toward, -2).add(vector(0.5));
      rig.go(goal, head, look);
      const world = rig.localToWorld(head.clone());
      expect(world.sub(goal).projectOnPlane(ground.up).length()).toBeLessThan(1e-9);
      expect(rig.aside(head, look)).toBeCloseTo(0, 6);
    }
  });

  test('somebody is aside by the angle to the left', () => {
    for (const { rig, head, spot } of cases) {
      rig.meet(spot, head);
      const look = ahead(head, spot);
      rig.turn(0.4, head); // to the left: who was before the visitor is to the right
      expect(rig.aside(head, look)).toBeCloseTo(-0.4, 6);
    }
  });

  test.each([[0.1, 0.8], [100, 8]])('does not go into somebody, nor out of sight: %d m become %d m', (wanted, apart) => {
    for (const { ground, eyes, rig, head, spot } of cases) {
      rig.meet(spot, head);
      rig.go(eyes.clone().addScaledVector(ground.toward, wanted), head, ahead(head, spot));
      const world = rig.localToWorld(head.clone());
      expect(world.sub(eyes).projectOnPlane(ground.up).length()).toBeCloseTo(apart, 6);
    }
  });

  test('turns around the visitor, who stays', () => {
    for (const { ground, rig, head, spot } of cases) {
      rig.meet(spot, head);
      const [before, turned] = [rig.localToWorld(head.clone()), rig.quaternion.clone()];
      rig.turn(0.5, head);
      close(rig.localToWorld(head.clone()), before);
      const expected = new Quaternion().setFromAxisAngle(ground.up, 0.5).multiply(turned);
      expect(rig.quaternion.angleTo(expected)).toBeLessThan(1e-6);
    }
  });
});
