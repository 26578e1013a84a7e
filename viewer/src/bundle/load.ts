import { PageError } from '../errors.ts';
import { checkAnimation, type AnimationInfo } from './animation.ts';
import { readBakedHead, type BakedHead } from './baked-head.ts';
import { checkManifest, type BodyInfo, type HeadInfo, type Manifest } from './manifest.ts';
import { parseSafetensors, takeTensor } from './safetensors.ts';

/** A head's files, checked and ready for the GPU. */
export interface HeadFiles {
  info: HeadInfo;
  baked: BakedHead;
  poses: Float32Array; // (F,4,4) row-major world_from_head
}

/** The names that splats behind a person may have. */
export const BACKGROUNDS = ['background.spz', 'background.ply'];

const ROOT = 'bundle/';
const HEAD_FILES = ['head.safetensors', 'head_poses.safetensors'] as const;

/** The thumbnail's address. */
export const THUMBNAIL = `${ROOT}thumbnail.png`;

/** Fetches and checks the manifest. */
export async function loadManifest(): Promise<Manifest> {
  const response = await get('manifest.json');
  return checkManifest(await response.json().catch(() => null));
}

/** Fetches and checks a head; `onBytes` is called with the number of bytes that came. */
export async function loadHead(
  manifest: Manifest,
  info: HeadInfo,
  onBytes: (n: number) => void,
): Promise<HeadFiles> {
  const [head, poses] = await Promise.all(HEAD_FILES.map((name) => loadFile(manifest, name, onBytes)));
  const poseTensors = parseSafetensors(poses!, HEAD_FILES[1]);
  return {
    info,
    baked: readBakedHead(parseSafetensors(head!, HEAD_FILES[0]), info, HEAD_FILES[0]),
    poses: takeTensor(poseTensors, 'world_from_head', 'F32', [info.num_poses, 4, 4], HEAD_FILES[1]).data as Float32Array,
  };
}

/** Bytes that must come before there is somebody to see. */
export function bytesToFirstSight({ head, body, files }: Manifest): number {
  const behind = BACKGROUNDS.filter((name) => name in files);
  const names = [...behind, ...(head ? HEAD_FILES : []), ...(body ? [body.windows[0]!.file] : [])];
  return names.reduce((sum, name) => sum + (files[name]?.size ?? 0), 0);
}

/** Fetches and checks how a whole person moves. */
export async function loadAnimation(manifest: Manifest, body: BodyInfo): Promise<AnimationInfo> {
  const text = new TextDecoder().decode(await loadFile(manifest, 'animation.json'));
  return checkAnimation(parseJson(text), body);
}

function parseJson(text: string): unknown {
  try {
    return JSON.parse(text);
  } catch {
    return null;
  }
}

async function get(name: string): Promise<Response> {
  let response: Response;
  try {
    response = await fetch(ROOT + name);
  } catch {
    throw new PageError(`The server does not answer, so ${name} could not be loaded; reload the page.`);
  }
  if (!response.ok) throw new PageError(`The server has no ${name} (status ${response.status}).`);
  return response;
}

/**
 * Fetches one file of the bundle; its size and hash must be those of the manifest.
 *
 * @param onBytes called with the number of bytes that came
 */
export async function loadFile(
  manifest: Manifest,
  name: string,
  onBytes: (n: number) => void = () => {},
): Promise<ArrayBuffer> {
  const entry = manifest.files[name];
  if (!entry) throw new PageError(`manifest.json does not list ${name}.`);
  const reader = (await get(name)).body!.getReader();
  const bytes = new Uint8Array(entry.size);
  let at = 0;
  for (let part = await reader.read(); !part.done; part = await reader.read()) {
    if (at + part.value.length > entry.size) throw new PageError(`${name} is longer than manifest.json says.`);
    bytes.set(part.value, at);
    at += part.value.length;
    onBytes(part.value.length);
  }
  if (at !== entry.size) throw new PageError(`${name} is shorter than manifest.json says.`);
  await checkHash(bytes, entry.sha256, name);
  return bytes.buffer;
}

/** Compares the hash where the browser can compute one (HTTPS and localhost). */
async function checkHash(bytes: Uint8Array<ArrayBuffer>, sha256: string, name: string): Promise<void> {
  if (!globalThis.crypto?.subtle) return;
  const digest = new Uint8Array(await crypto.subtle.digest('SHA-256', bytes));
  const hex = Array.from(digest, (byte) => byte.toString(16).padStart(2, '0')).join('');
  if (hex !== sha256) throw new PageError(`${name} differs from what manifest.json promises; reload the page.`);
}
