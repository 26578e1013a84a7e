import { beforeAll, describe, expect, test } from 'vitest';
import { DISPLAY_LEAD } from '../../src/face/face.ts';
import type { Figure } from '../../src/gesture/figure.ts';
import { Living } from '../../src/gesture/living.ts';
import { chance, scrambled, wander } from '../../src/gesture/noise.ts';
import { BodyLanguage } from '../../src/gesture/performing/body-language.ts';
import type { Direction } from '../../src/gesture/performing/cues.ts';
import { directionTo, Gaze } from '../../src/gesture/performing/gaze.ts';
import { Listener, Loudness } from '../../src/gesture/performing/listening.ts';
import { Performer } from '../../src/gesture/performing/performer.ts';
import { jointMotion, Placement, type RigPose } from '../../src/gesture/placement.ts';
import { readRepertoire, type Repertoire } from '../../src/gesture/repertoire.ts';
import { Retarget } from '../../src/gesture/retarget.ts';
import { about, aligned, arc, power, twistAngle } from '../../src/gesture/turning.ts';
import type { Spoken } from '../../src/motion/director.ts';
import { add, conjugate, dotQuat, fromRotvec, multiply, rotate, slerp, subtract, toRotvec, type Quat, type Vector } from '../../src/rig/quaternions.ts';
import { Rig } from '../../src/rig/rig.ts';
import { makeGestureReference, type GestureReference, type Moved, type Performance, type PersonReference } from '../../support/references/gestures/reference.ts';

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
      const bones = new Rig(parents, joints);
      const found = rig.rotations.map((rotations, i) => [...bones.matrices(bones.posed(rotations, rig.roots[i]!))]);
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

describe('files of gestures', () => {
  interface Header {
    __metadata__: { clips: string; figure: string };
    [tensor: string]: unknown;
  }

  /** The file of a person with another header, or with other bytes behind it. */
  function changed(change: (header: Header) => void, data: (bytes: Uint8Array) => void = () => {}): ArrayBuffer {
    const { file } = people[0]![1];
    const length = Number(new DataView(file).getBigUint64(0, true));
    const header = JSON.parse(new TextDecoder().decode(new Uint8Array(file, 8, length))) as Header;
    change(header);
    const text = new TextEncoder().encode(JSON.stringify(header));
    const bytes = new Uint8Array(8 + text.length + file.byteLength - 8 - length);
    new DataView(bytes.buffer).setBigUint64(0, BigInt(text.length), true);
    bytes.set(text, 8);
    bytes.set(new Uint8Array(file, 8 + length), 8 + text.length);
    data(bytes.subarray(8 + text.length));
    return bytes.buffer;
  }

  const read = (buffer: ArrayBuffer) => readRepertoire(buffer, 'gestures', people[0]![1].parents.length);
  /** A change of the figure or of the clips in the header. */
  function inHeader(key: 'clips' | 'figure', change: (value: any) => void): ArrayBuffer {
    return changed(({ __metadata__ }) => {
      const value = JSON.parse(__metadata__[key]);
      change(value);
      __metadata__[key] = JSON.stringify(value);
    });
  }

  test('are read whatever their header', () => {
    expect(read(changed(() => {})).clips.size).toBe(people[0]![2].clips.size);
  });

  test('without figure or clips are refused', () => {
    expect(() => read(changed(({ __metadata__ }) => (__metadata__.figure = '{')))).toThrow('without its figure');
    expect(() => read(changed((header) => delete (header as Partial<Header>).__metadata__))).toThrow('without its figure');
    expect(() => read(inHeader('clips', (clips) => (clips.version = 2)))).toThrow('has version 2, not 1');
    expect(() => read(people[0]![1].file.slice(0, 1000))).toThrow('gestures ends before');
  });

  test('whose curves are none are refused', () => {
    const rename = (from: string, to: string) => (header: Header) => {
      header[to] = header[from];
      delete header[from];
    };
    expect(() => read(changed(rename('nod/head/rotations', 'nod/tail/rotations')))).toThrow('nod/tail/rotations');
    expect(() => read(changed(rename('nod/head/times', 'nod/head/when')))).toThrow('nod/head/rotations');
    expect(() => read(changed(() => {}, (bytes) => bytes.fill(0)))).toThrow(/are wrong/);
    expect(() => read(inHeader('clips', ({ marks }) => (marks.nod.end = 0.01)))).toThrow('nod holds no gesture: its marks are wrong');
    expect(() => read(inHeader('clips', ({ marks }) => (marks.nod.stroke = null)))).toThrow('marks are wrong');
    expect(() => read(inHeader('clips', ({ marks }) => (marks.nod.ready = marks.nod.stroke = 0)))).toThrow('marks are wrong');
  });

  test('of another rig, or with impossible figures, are refused', () => {
    const damages: [string, (figure: any) => void][] = [
      ['height', (figure) => (figure.height = null)],
      ['eyes', (figure) => figure.eyes.pop()],
      ['hung', (figure) => (figure.hung[3] = [0, 0, 0, 0])],
      ['parts of head', (figure) => (figure.parts[4].joints = [999])],
      ['parts of tail', (figure) => (figure.parts[4].role = 'tail')],
      ['parts of left_shoulder', (figure) => (figure.parts.find(({ role }: any) => role === 'left_shoulder').axes = [[2, 0, 0]])],
      ['legs.left', (figure) => (figure.legs.left.lengths = [0, 1])],
      ['legs.right', (figure) => delete figure.legs.right],
    ];
    for (const [field, damage] of damages) {
      expect(() => read(inHeader('figure', damage)), field).toThrow(`damaged: ${field} of the figure is wrong`);
    }
  });
});

describe('body language', () => {
  const BEAT: Direction[] = [
    { number: 0, name: 'beat_right', mirror: false, begin: 1, stroke: 1.65, skip: 0 },
    { number: 0, time: 2.5 },
  ];
  const SHRUG: Direction = { number: 1, name: 'shrug', mirror: false, begin: 1, stroke: 1.8, skip: 0 };
  let heard: Spoken | null;

  function body(): { self: BodyLanguage; number: (role: string) => number; joint: (role: string) => Quat } {
    heard = null;
    const [, { parents, joints }, repertoire] = people[0]!;
    const self = new BodyLanguage(new Rig(parents, joints), repertoire, 1, () => heard);
    const number = (role: string) => repertoire.figure.parts.find((part) => part.role === role)!.joints[0]!;
    return { self, number, joint: (role) => self.pose().rotations[number(role)]! };
  }

  /** Degrees between two rotations. */
  function degrees(a: Quat, b: Quat): number {
    return (360 / Math.PI) * Math.acos(Math.min(1, Math.abs(dotQuat(a, b))));
  }

  test('gestures with the sound, stands still with it, and goes on when the sound is over', () => {
    const { self, joint } = body();
    self.advance(20);
    self.plan(3, BEAT);
    const rest = joint('right_elbow');
    heard = { utterance: 3, seconds: 1.65 - DISPLAY_LEAD };
    self.advance(0.02);
    const stroke = joint('right_elbow');
    expect(degrees(stroke, rest)).toBeGreaterThan(30);
    heard = { ...heard, paused: true };
    self.advance(4);
    expectAlike(joint('right_elbow'), stroke, 'paused');
    heard = null;
    self.advance(0.6);
    expect(degrees(joint('right_elbow'), rest)).toBeGreaterThan(30);
    self.advance(3);
    expect(degrees(joint('right_elbow'), rest)).toBeLessThan(8);
  });

  test.each([[0, 0, 3], [2999, 20, 180]])('of 3000 utterances that wait the last hundred are acted: %d', (utterance, least, most) => {
    const { self, joint } = body();
    for (let i = 0; i < 3000; i++) self.plan(i, [SHRUG]);
    self.advance(1);
    const before = joint('left_shoulder');
    for (const seconds of [0, 1, 1.8]) {
      heard = { utterance, seconds };
      self.advance(0.8);
    }
    const moved = degrees(joint('left_shoulder'), before);
    expect(moved >= least && moved < most).toBe(true);
  });

  test('does as Python does at the time of the sound', () => {
    const [, { composed, parents, joints }, { figure, clips }] = people.find(([, person]) => person.composed)!;
    const self = new BodyLanguage(new Rig(parents, joints), { figure, clips }, reference.seed, () => heard);
    const performer = new Performer(new Living(figure, reference.seed), clips);
    const retarget = new Retarget(new Rig(parents, joints), figure);
    performer.follow(composed!.directions, { offset: 0 });
    self.plan(0, composed!.directions);
    const times = [...composed!.times].toSorted((a, b) => a - b);
    for (const [i, time] of times.entries()) {
      heard = { utterance: 0, seconds: time - DISPLAY_LEAD };
      self.advance(time - (times[i - 1] ?? 0));
      const wanted = performer.at(time);
      expectAlike(self.pose().rotations, retarget.pose(wanted.pose), `${time} s`);
      expectAlike(self.pose().root, wanted.root, `${time} s`);
    }
  });

  test('lets go when it is interrupted, and never makes what nobody heard', () => {
    const { self, joint } = body();
    self.advance(20);
    const rest = joint('right_elbow');
    self.plan(0, [SHRUG]); // held until it is released
    self.plan(1, [SHRUG]);
    heard = { utterance: 1, seconds: 3 };
    self.advance(0.02);
    expect(degrees(joint('right_elbow'), rest)).toBeGreaterThan(30);
    self.stop(1);
    heard = null;
    self.advance(4);
    expect(degrees(joint('right_elbow'), rest)).toBeLessThan(8);
    self.plan(0, [SHRUG]);
    self.plan(1, [SHRUG]);
    self.reset();
    heard = { utterance: 0, seconds: 3 };
    self.advance(0.02);
    expect(degrees(joint('right_elbow'), rest)).toBeLessThan(8);
  });

  test.each([-1, 1])('looks at a visitor who is near, not past: side %d', (side) => {
    const [, { parents, joints }, { figure }] = people[0]!;
    const [{ self, number }, rig, visitor] = [body(), new Rig(parents, joints), add(figure.eyes, [0.7 * side, 0, 0.4])];
    const past = Array.from({ length: 400 }, () => {
      self.look(visitor);
      self.advance(0.9);
      const { turned, places } = rig.posed(self.pose().rotations, self.pose().root);
      const [way, place, rest] = [turned, places, joints].map((of) => of[number('head')]!) as [Quat, Vector, Vector];
      const [x, , z] = subtract(rotate(conjugate(way), subtract(visitor, place)), subtract(figure.eyes, rest)); // by eyes that look along z
      return (-180 / Math.PI) * Math.atan2(x, z) * side;
    });
    expect(Math.abs(past.slice(10).reduce((sum, angle) => sum + angle / 390, 0))).toBeLessThan(2);
  });

  test('nods to the visitor, but not while it speaks itself', () => {
    const listen = (speaks: boolean) => {
      const [{ self, joint }, still] = [body(), body()];
      const { pcm } = reference.listening;
      const angles: number[] = [];
      heard = speaks ? { utterance: 0, seconds: 1 } : null;
      for (let first = 0; first < 20 * 16_000; first += 1600) {
        self.listen(pcm.subarray(first, first + 1600));
        for (const one of [self, still.self]) one.advance(0.1);
        angles.push(degrees(joint('head'), still.joint('head')));
      }
      return Math.max(...angles);
    };
    expect(listen(false)).toBeGreaterThan(2);
    expect(listen(true)).toBeLessThan(1e-3);
  });
});

describe('where somebody was recorded', () => {
  /** The person of a reference, recorded turned by an angle, somewhere. */
  function recorded(angle: number): { rig: Rig; figure: Figure; pose: RigPose; joint: (role: string) => number } {
    const [, { parents, joints, retarget }, { figure }] = people[1]!;
    const rotations = [...retarget.joints.at(-1)!]; // of the living rest
    rotations[0] = multiply(about([0, 1, 0], angle), rotations[0]!);
    const joint = (role: string) => figure.parts.find((part) => part.role === role)!.joints.at(-1)!;
    return { rig: new Rig(parents, joints), figure, pose: { rotations, root: [3, 0.2, -1] }, joint };
  }

  test('they stand, feet and front as they were', () => {
    const { rig, figure, pose, joint } = recorded(2);
    const placement = new Placement(rig, figure, pose);
    const living = new Living(figure, 9).at(77);
    const stands = { rotations: new Retarget(rig, figure).pose(living.pose), root: living.root };
    const ankles = ({ rotations, root }: RigPose) => {
      const { places } = rig.posed(rotations, root);
      return [places[joint('left_ankle')]!, places[joint('right_ankle')]!];
    };
    const [before, after] = [ankles(pose), ankles(placement.place(stands))];
    for (const axis of [0, 1, 2]) {
      expect(after[0]![axis]! + after[1]![axis]!).toBeCloseTo(before[0]![axis]! + before[1]![axis]!, 6);
    }
    const across = subtract(after[0]!, after[1]!); // from the right to the left foot
    expect(Math.atan2(-across[2], across[0])).toBeCloseTo(2, 0.5);
    expectAlike(ankles(stands), after.map((point) => placement.toRest(point)), 'toRest');
  });

  test('as Python places them', () => {
    for (const [name, { parents, joints, rig, retarget, living, footing }, { figure }] of people) {
      const placement = new Placement(new Rig(parents, joints), figure, { rotations: rig.rotations[0]!, root: rig.roots[0]! });
      const found = [0, 1, 2].map((i) => placement.place({ rotations: retarget.joints[3 + i]!, root: living.root[i]! }));
      expectAlike(found.map(({ rotations }) => rotations), footing.rotations, `${name}: rotations`);
      expectAlike(found.map(({ root }) => root), footing.root, `${name}: root`);
    }
  });

  test('a joint carries what hangs on it', () => {
    const [{ rig, pose: from, joint }, { pose: to }] = [recorded(2), recorded(-1)];
    const [turn, shift] = jointMotion(rig, joint('head'), from, { ...to, root: [0, 0.1, 0.2] });
    const chin: Vector = [0.05, 1.4, 0.1];
    const carried = ({ rotations, root }: RigPose) => {
      const { turned, places } = rig.posed(rotations, root);
      return add(places[joint('head')]!, rotate(turned[joint('head')]!, subtract(chin, rig.joints[joint('head')]!)));
    };
    expectAlike(add(rotate(turn, carried(from)), shift), carried({ ...to, root: [0, 0.1, 0.2] }), 'chin');
  });
});
