import { PageError } from '../errors.ts';

/** Where the visitor starts, world space. */
export interface StartCamera {
  eye: [number, number, number];
  target: [number, number, number];
  up: [number, number, number];
  fov_y: number; // degrees
}

/** What the page reads of `manifest.json`; `docs/bundle.md` describes it whole. */
export interface Manifest {
  name: string;
  files: Record<string, { sha256: string; size: number }>;
  head: {
    num_gaussians: number;
    rank: number;
    hidden: number;
    inputs: 'speech' | 'blendshapes';
    expression_size: number;
    eye_offset: number | null;
    expression_names: string[];
    fps: number;
    num_poses: number;
    idle_expression: number[];
  };
  camera: StartCamera;
  background: [number, number, number];
  persona: { name: string; greeting: string };
}

const FORMAT = 'ico3d-bundle';
const VERSION = 1;

/**
 * Checks a parsed manifest as far as the page relies on it.
 *
 * @throws PageError naming the first thing that is wrong
 */
export function checkManifest(value: unknown): Manifest {
  const manifest = value as Manifest & { format?: string; version?: number };
  if (manifest?.format !== FORMAT) throw new PageError('manifest.json is not that of an avatar bundle.');
  if (manifest.version !== VERSION) {
    throw new PageError(`This avatar has format version ${manifest.version}; the page reads ${VERSION}.`);
  }
  const { head, camera, background } = manifest;
  for (const key of ['num_gaussians', 'rank', 'hidden', 'expression_size', 'num_poses', 'fps'] as const) {
    if (!(Number.isFinite(head?.[key]) && head[key] > 0)) bad(`head.${key}`);
  }
  if (!isNumbers(head.idle_expression, head.expression_size)) bad('head.idle_expression');
  for (const key of ['eye', 'target', 'up'] as const) if (!isNumbers(camera?.[key], 3)) bad(`camera.${key}`);
  if (!(camera.fov_y > 0 && camera.fov_y < 180)) bad('camera.fov_y');
  if (!isNumbers(background, 3)) bad('background');
  return manifest;
}

function isNumbers(value: unknown, length: number): boolean {
  return Array.isArray(value) && value.length === length && value.every(Number.isFinite);
}

function bad(field: string): never {
  throw new PageError(`manifest.json: ${field} is missing or not what it should be.`);
}

/** Indices of the two eyelid values in the expression, or none. */
export function blinkIndices(head: Manifest['head']): number[] {
  if (head.eye_offset !== null) return [head.eye_offset + 5, head.eye_offset + 6]; // behind five brow values
  return ['eyeBlinkLeft', 'eyeBlinkRight'].map((n) => head.expression_names.indexOf(n)).filter((i) => i >= 0);
}
