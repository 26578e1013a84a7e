import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import type { Quat, Vector } from '../../../src/rig/quaternions.ts';
import type { Direction } from '../../../src/gesture/performing/cues.ts';
import { runPython } from '../../python.ts';
import { scratchFolder } from '../../scratch.ts';
import { arrayBuffer } from '../head.ts';

/** A body at several times. */
export interface Moved {
  times: number[];
  pose: Quat[][]; // by role
  root: Vector[];
}

export interface Performance extends Moved {
  directions: Direction[];
  turn: Quat[][]; // of chest, neck and head
}

/** What one person does (`gesture_reference.py`). */
export interface PersonReference {
  file: ArrayBuffer; // figure and clips
  parents: number[];
  joints: Vector[];
  curves: { name: string; times: number[]; roles: [number[], number[]]; poses: [Quat[][], Quat[][]] }[]; // as made and mirrored
  living: Moved;
  retarget: { pose: Quat[][]; joints: Quat[][] };
  rig: { rotations: Quat[][]; roots: Vector[]; matrices: number[][][][] }; // (3,J,3,4)
  random: Performance;
  footing: { rotations: Quat[][]; root: Vector[] }; // the last poses of `retarget` where the first of `rig` stood
  composed?: Performance;
  interrupted?: Moved & { directions: Direction[]; now: number; let_go: Direction[] };
}

/** What Python makes of people who move. */
export interface GestureReference {
  seed: number;
  quaternions: {
    a: Quat[];
    b: Quat[];
    vectors: Vector[];
    part: number[];
    u: Vector[];
    v: Vector[];
    across: Vector[];
    multiplied: Quat[];
    rotated: Vector[];
    from_rotvec: Quat[];
    to_rotvec: Vector[];
    slerped: Quat[];
    power: Quat[];
    arc: Quat[];
    aligned: Quat[];
    twist: number[];
  };
  noise: { numbers: number[][]; scrambled: number[]; chance: number[]; times: number[]; wander: number[] };
  gaze: { eyes: Vector; visitors: Vector[]; times: number[]; turns: Quat[][] };
  listening: { pcm: Int16Array; levels: number[]; nods: [number, string][][] };
  people: Record<string, PersonReference>;
}

/** Lets Python move them; takes some seconds. */
export function makeGestureReference(): GestureReference {
  const folder = scratchFolder();
  runPython('references/gestures/gesture_reference.py', folder);
  const found = JSON.parse(readFileSync(join(folder, 'reference.json'), 'utf8')) as GestureReference;
  found.listening.pcm = new Int16Array(arrayBuffer(readFileSync(join(folder, 'sound.i16'))));
  for (const [name, person] of Object.entries(found.people)) {
    person.file = arrayBuffer(readFileSync(join(folder, `${name}.safetensors`)));
  }
  return found;
}
