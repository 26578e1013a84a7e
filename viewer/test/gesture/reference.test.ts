import { beforeAll, describe, expect, test } from 'vitest';
import { Living } from '../../src/gesture/living.ts';
import { chance, scrambled, wander } from '../../src/gesture/noise.ts';
import { directionTo, Gaze } from '../../src/gesture/performing/gaze.ts';
import { Listener, Loudness } from '../../src/gesture/performing/listening.ts';
import { Performer } from '../../src/gesture/performing/performer.ts';
import { readRepertoire, type Repertoire } from '../../src/gesture/repertoire.ts';
import { Retarget } from '../../src/gesture/retarget.ts';
import { aligned, arc, power, twistAngle } from '../../src/gesture/turning.ts';
import { fromRotvec, multiply, rotate, slerp, toRotvec } from '../../src/rig/quaternions.ts';
import { Rig } from '../../src/rig/rig.ts';
import { makeGestureReference, type GestureReference, type Moved, type Performance, type PersonReference } from '../../support/references/gestures.ts';

type Nested = number | readonly Nested[];

const TOLERANCE = 1e-9; // of quaternions' components, metres and radians

let reference: GestureReference;
let people: [string, PersonReference, Repertoire][];

beforeAll(() => {
  reference = makeGestureReference();
  people = Object.entries(reference.people).map(([name, person]) => [name, person, readRepertoire(person.file, name, person.parents.length)]);
}, 60_000);

/** All numbers are the same but for the last digits. */
function expectAlike(found: Nested, wanted: Nested, where: string, tolerance = TOLERANCE): void {
  const [own, theirs] = [[found].flat(9) as number[], [wanted].flat(9) as number[]];
  expect(own.length, where).toBe(theirs.length);
  expect(theirs.length, where).toBeGreaterThan(0);
  const worst = own.reduce((most, value, i) => Math.max(most, Math.abs(value - theirs[i]!)), 0);
  expect(worst, where).toBeLessThan(tolerance); // also where it is NaN
}

function expectMoved(moment: (i: number) => { pose: Nested; root: Nested }, { times, pose, root }: Moved, where: string): void {
  const found = times.map((_, i) => moment(i));
  expectAlike(found.map((one) => one.pose), pose, `${where}: pose`);
  expectAlike(found.map((one) => one.root), root, `${where}: root`);
}

test('rotations', () => {
  const { a, b, vectors, part, u, v, across, ...wanted } = reference.quaternions;
  expectAlike(a.map((quat, i) => multiply(quat, b[i]!)), wanted.multiplied, 'multiply');
  expectAlike(a.map((quat, i) => rotate(quat, vectors[i]!)), wanted.rotated, 'rotate');
  expectAlike(vectors.map(fromRotvec), wanted.from_rotvec, 'fromRotvec');
  expectAlike(a.map(toRotvec), wanted.to_rotvec, 'toRotvec');
  expectAlike(a.map((quat, i) => slerp(quat, b[i]!, part[i]!)), wanted.slerped, 'slerp');
  expectAlike(a.map((quat, i) => power(quat, part[i]!)), wanted.power, 'power');
  expectAlike(u.map((start, i) => arc(start, v[i]!)), wanted.arc, 'arc');
  expectAlike(u.map((start, i) => aligned([start, across[i]!], [v[i]!, across[i]!])), wanted.aligned, 'aligned');
  expectAlike(a.map((quat) => twistAngle(quat, u[0]!)), wanted.twist, 'twistAngle');
});

test('noise', () => {
  const { numbers, times, ...wanted } = reference.noise;
  expect(numbers.map((row) => scrambled(...row))).toEqual(wanted.scrambled);
  expect(numbers.map((row) => chance(...row))).toEqual(wanted.chance);
  expectAlike(times.map((time) => wander(time, 9.7, reference.seed, 3)), wanted.wander, 'wander');
});

test('gaze', () => {
  const gaze = new Gaze();
  const { eyes, visitors, times, turns } = reference.gaze;
  const found = visitors.map((visitor, i) => {
    gaze.look(...directionTo(eyes, visitor));
    return gaze.at(times[i]!);
  });
  expectAlike(found, turns, 'gaze');
});

describe('listening', () => {
  test('loudness, in whatever pieces sound comes', () => {
    const { pcm, levels } = reference.listening;
    for (const piece of [512, 16_000, 77]) {
      const loudness = new Loudness(16_000);
      const found: number[] = [];
      for (let first = 0; first < pcm.length; first += piece) found.push(...loudness.push(pcm.subarray(first, first + piece)));
      expect(levels.length - found.length).toBeLessThan(3); // the last ones wait for more sound
      expectAlike(found, levels.slice(0, found.length), `pieces of ${piece}`, 1e-6); // Python subtracts sums of the whole sound
    }
  });

  test('nods', () => {
    const { levels, nods } = reference.listening;
    expect(nods.flat().length).toBeGreaterThan(5);
    expect(nods.map((_, seed) => new Listener(seed).hear(levels))).toEqual(nods);
  });
});

describe('people', () => {
  test('rigs that are posed', () => {
    for (const [name, { parents, joints, rig }] of people) {
      const found = rig.rotations.map((rotations, i) => [...new Rig(parents, joints).matrices(rotations, rig.roots[i]!)]);
      expectAlike(found, rig.matrices, name);
    }
  });

  test('poses by role on rigs of other names and rests', () => {
    for (const [name, { parents, joints, retarget }, { figure }] of people) {
      const own = new Retarget(new Rig(parents, joints), figure);
      expectAlike(retarget.pose.map((pose) => own.pose(pose)), retarget.joints, name);
    }
  });

  test('clips, as made and mirrored', () => {
    for (const [name, { curves }, { clips }] of people) {
      expect([...clips.keys()]).toEqual(curves.map((curve) => curve.name));
      for (const { name: clip, times, roles, poses } of curves) {
        const own = clips.get(clip)!;
        for (const [i, one] of [own, own.mirrored()].entries()) {
          const found = times.map((time) => one.at(time));
          expect([...one.curves.keys()]).toEqual(roles[i]);
          expectAlike(found.map((row) => row.map(([, quat]) => quat)), poses[i]!, `${name}: ${clip}`);
        }
      }
    }
  });

  test('the living rest over feet that stay', () => {
    for (const [name, { living }, { figure }] of people) {
      const own = new Living(figure, reference.seed);
      expectMoved((i) => own.at(living.times[i]!), living, name);
    }
  });

  test('gestures that come and go, turned to a visitor', () => {
    for (const [name, { random, composed }, repertoire] of people) {
      for (const performance of [random, composed]) if (performance) follow(performance, repertoire, name);
    }
    expect(people.filter(([, person]) => person.composed).length).toBe(1);
  });

  function follow({ directions, turn, ...moved }: Performance, { figure, clips }: Repertoire, where: string): void {
    const performer = new Performer(new Living(figure, reference.seed), clips);
    performer.follow(directions, { offset: 0 });
    expectMoved((i) => performer.at(moved.times[i]!, turn[i]), moved, where);
  }

  test('an interruption', () => {
    const [, { interrupted }, { figure, clips }] = people.find(([, person]) => person.interrupted)!;
    const { directions, now, let_go, ...moved } = interrupted!;
    expect(let_go.length).toBeGreaterThan(0);
    const performer = new Performer(new Living(figure, reference.seed), clips);
    const clock = { offset: 0 };
    performer.follow(directions, clock);
    performer.stop(clock, now);
    expectMoved((i) => performer.at(moved.times[i]!), moved, 'interrupted');
  });
});
