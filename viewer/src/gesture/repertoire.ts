import { parseMetadata, parseSafetensors, type Tensor } from '../bundle/safetensors.ts';
import { PageError } from '../errors.ts';
import { dotQuat, normalized, type Quat } from '../rig/quaternions.ts';
import { Clip, type Marks } from './clip.ts';
import { Curve } from './curves.ts';
import { checkFigure, type Figure } from './figure.ts';
import { findRole } from './roles.ts';

const VERSION = 1;
const SCALE = 32767; // the int16 that stands for 1
const TICKS = 1000; // key times are whole milliseconds
const LONGEST = 60; // longest duration of a curve, s
const PHASES = ['ready', 'stroke', 'hold', 'release', 'end'] as const;

/** A person's figure and gestures. */
export interface Repertoire {
  figure: Figure;
  clips: Map<string, Clip>; // by name
}

/**
 * Reads a file of gestures, as `ico3d/motion/repertoire.py` writes it.
 *
 * @param file its name, for error messages
 * @param joints number of the joints of the rig that it is for
 * @throws PageError if the file is damaged or does not hold gestures
 */
export function readRepertoire(buffer: ArrayBuffer, file: string, joints: number): Repertoire {
  const tensors = parseSafetensors(buffer, file);
  const metadata = parseMetadata(buffer, file);
  const about = parsed(metadata['clips'], file) as { version?: number; marks?: Record<string, Marks> } | null;
  if (about?.version !== VERSION) throw new PageError(`${file} has version ${about?.version}, not ${VERSION}.`);
  const curves = readCurves(tensors, file);
  const clips = Object.entries(about.marks ?? {}).map(([name, marks]): [string, Clip] => {
    const own = [...(curves.get(name) ?? [])].toSorted(([a], [b]) => a - b);
    return [name, new Clip(name, checkMarks(marks, `${file}: ${name}`), new Map(own))];
  });
  return { figure: checkFigure(parsed(metadata['figure'], file), joints), clips: new Map(clips) };
}

function parsed(text: string | undefined, file: string): unknown {
  try {
    return JSON.parse(text ?? '') as unknown;
  } catch {
    throw new PageError(`${file} has a header without its figure or its clips.`);
  }
}

/** Curves of each clip, by index of the role. */
function readCurves(tensors: Map<string, Tensor>, file: string): Map<string, Map<number, Curve>> {
  const found = new Map<string, Map<number, Curve>>();
  for (const [key, rotations] of tensors) {
    const [name, role, what] = key.split('/');
    if (what !== 'rotations') continue;
    const number = findRole(role ?? '');
    const times = tensors.get(`${name}/${role}/times`);
    if (number === undefined || times?.dtype !== 'U16' || rotations.dtype !== 'I16') bad(file, key);
    const ofClip = found.get(name!) ?? new Map<number, Curve>();
    found.set(name!, ofClip.set(number, readCurve(times, rotations, `${file}: ${name}/${role}`)));
  }
  return found;
}

function readCurve(ticks: Tensor, rotations: Tensor, where: string): Curve {
  const times = Array.from(ticks.data, (tick) => tick / TICKS);
  const ascends = times.every((time, i) => (i === 0 ? time === 0 : time > times[i - 1]!));
  if (times.length === 0 || !ascends || times.at(-1)! > LONGEST) bad(where, 'times');
  if (rotations.shape.join() !== `${times.length},4`) bad(where, 'rotations');
  const found: Quat[] = [];
  for (let i = 0; i < times.length; i++) {
    const [w, x, y, z] = Array.from(rotations.data.subarray(4 * i, 4 * i + 4), (value) => value / SCALE);
    const quat: Quat = [w!, x!, y!, z!];
    if (Math.abs(Math.sqrt(dotQuat(quat, quat)) - 1) > 1e-3) bad(where, 'rotations');
    found.push(near(normalized(quat), found.at(-1)));
  }
  return new Curve(times, found);
}

/** The same rotation with the sign that is nearer to the quaternion before it. */
function near(quat: Quat, before: Quat | undefined): Quat {
  if (!before || dotQuat(quat, before) >= 0) return quat;
  return [-quat[0], -quat[1], -quat[2], -quat[3]];
}

function checkMarks(marks: Marks, where: string): Marks {
  const order = [0, ...PHASES.map((phase) => marks?.[phase])];
  if (!order.every((mark, i) => i === 0 || order[i - 1]! <= mark!) || marks.stroke === 0) bad(where, 'marks');
  return marks;
}

function bad(where: string, what: string): never {
  throw new PageError(`${where} holds no gesture: its ${what} are wrong.`);
}
