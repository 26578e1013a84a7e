import { PageError } from '../errors.ts';
import { MOST } from '../shared.ts';
import { say } from '../words/text.ts';
import { checkAnimation, type AnimationInfo } from './animation.ts';
import { readBakedHead, readHeadRows, type BakedHead, type HeadRows } from './baked-head.ts';
import { checkManifest, type AnyBody, type HeadInfo, type Manifest } from './manifest.ts';
import { parseSafetensors, takeTensor, type Tensor } from './safetensors.ts';
import { parseCalmly } from '../words/calm.ts';

/** A head's files, checked and ready for the GPU. */
export interface HeadFiles {
  info: HeadInfo;
  baked: BakedHead; // its most important Gaussians, if others have a file of their own
  poses: Float32Array; // (F,4,4) row-major world_from_head
  shoulders: ShouldersFile | null; // null where all follows the head
}

/** How the shoulders of a head alone stand. */
export interface ShouldersFile {
  share: Uint8Array; // (N,) how much each Gaussian moves with them, of 255
  poses: Float32Array; // (F,4,4) row-major world_from_shoulders
}

/** The names that splats behind a person may have. */
const BACKGROUNDS = ['background.spz', 'background.ply'];

const HEAD_FILES = ['head.safetensors', 'head_poses.safetensors'] as const;
const HEAD_REST = 'head_rest.safetensors';
const SHOULDERS = 'head_shoulders.safetensors';
const ANIMATION = 'animation.json';
const MANIFEST = 'manifest.json';

/** The file of a body on a skeleton. */
export const SKINNED = 'body/skinned.safetensors';

/** Its less important Gaussians, where they have a file of their own. */
export const SKINNED_REST = 'body/skinned_rest.safetensors';

/** What such a body can do besides what was recorded. */
export const GESTURES = 'body/gestures.safetensors';

/** A picture of the avatar. */
export const THUMBNAIL = 'thumbnail.png';

/** Gives the address of a file of a bundle; with its hash, one whose content never changes. */
export type Locate = (name: string, sha256?: string) => string;

/** Fetches and checks the manifest. */
export async function loadManifest(locate: Locate, signal?: AbortSignal): Promise<Manifest> {
  const response = await get(locate(MANIFEST), MANIFEST, signal);
  return checkManifest(parseJson(new TextDecoder().decode(await readAll(response, MOST.manifest_bytes))));
}

/**
 * What a response holds, which may be packed on the way: it is read no further than it may be long.
 *
 * @throws PageError if it is longer
 */
async function readAll(response: Response, most: number): Promise<Uint8Array<ArrayBuffer>> {
  const reader = response.body!.getReader();
  const parts: Uint8Array<ArrayBuffer>[] = [];
  let length = 0;
  for (let part = await reader.read(); !part.done; part = await reader.read()) {
    length += part.value.length;
    if (length > most) {
      reader.cancel().catch(() => {});
      throw new PageError(`${MANIFEST} is larger than ${most} bytes.`);
    }
    parts.push(part.value);
  }
  return new Uint8Array(await new Blob(parts).arrayBuffer());
}

/**
 * What must come before there is somebody to see, the face first; of a person's windows, their animation says which.
 *
 * @param alone nothing is shown behind them
 */
export function filesToFirstSight({ head, body, skinned, files }: Manifest, alone = false): string[] {
  const names: string[] = head ? [...HEAD_FILES, SHOULDERS] : [];
  if (head && (body || skinned)) names.push(ANIMATION);
  if (body && !head) names.push(body.windows[0]!.file);
  if (skinned) names.push(SKINNED, GESTURES);
  if (!alone) names.push(...BACKGROUNDS);
  return names.filter((name) => name in files);
}

/** Tells an avatar in the part that it plays from others, by what a page knows of both. */
export function identityOf({ name, persona, files }: Manifest): string {
  const head = HEAD_FILES.map((file) => files[file]?.sha256);
  return JSON.stringify([name, persona.name, persona.greeting, persona.languages, ...head]);
}

/** What somebody is made of, in the order in which it is told. */
export const PARTS = ['face', 'body', 'place'] as const;
export type Part = (typeof PARTS)[number];

/** What a file belongs to. */
function partOf(name: string): Part {
  if (name.startsWith('head')) return 'face';
  return (BACKGROUNDS as readonly string[]).includes(name) ? 'place' : 'body';
}

/** The files of a bundle, fetched when they are asked for; each must be as long as promised, and have the promised hash. */
export class BundleFiles {
  /** Bytes that came so far. */
  loaded = 0;
  /** Files that were asked for and have not come yet. */
  private readonly coming = new Set<string>();
  private readonly locate: Locate;
  private readonly promised: Manifest['files'];
  private readonly onBytes: () => void;
  private readonly signal: AbortSignal | undefined;
  private readonly asked = new Map<string, Promise<ArrayBuffer>>(); // ahead of their use

  /**
   * @param promised size and hash of each file
   * @param onBytes called when some bytes came
   * @param signal ends the fetching
   */
  constructor(locate: Locate, promised: Manifest['files'], onBytes: () => void = () => {}, signal?: AbortSignal) {
    this.locate = locate;
    this.promised = promised;
    this.onBytes = onBytes;
    this.signal = signal;
  }

  /** Asks for files that are going to be used, in this order; each is handed out once. */
  ask(names: readonly string[]): void {
    for (const name of names) {
      const coming = this.fetch(name);
      coming.catch(() => {}); // whoever uses the file hears of it
      this.asked.set(name, coming);
    }
  }

  /** A head, ready for the GPU. */
  async head(info: HeadInfo): Promise<HeadFiles> {
    const coming = HEAD_FILES.map((name) => this.tensors(name));
    const [[head, poses], shoulders] = await Promise.all([Promise.all(coming), this.shoulders(info)]);
    return {
      info,
      baked: readBakedHead(head!, info, HEAD_FILES[0]),
      poses: takeTensor(poses!, 'world_from_head', 'F32', [info.num_poses, 4, 4], HEAD_FILES[1]).data as Float32Array,
      shoulders,
    };
  }

  /** How the shoulders of a head alone stand, if they do not follow it. */
  private async shoulders({ num_gaussians, num_poses }: HeadInfo): Promise<ShouldersFile | null> {
    if (!(SHOULDERS in this.promised)) return null;
    const tensors = await this.tensors(SHOULDERS);
    return {
      share: takeTensor(tensors, 'share', 'U8', [num_gaussians], SHOULDERS).data as Uint8Array,
      poses: takeTensor(tensors, 'world_from_shoulders', 'F32', [num_poses, 4, 4], SHOULDERS).data as Float32Array,
    };
  }

  /** The less important Gaussians of a head, which have a file of their own. */
  async headRest({ num_rest, rank, num_displacements }: HeadInfo): Promise<HeadRows> {
    return readHeadRows(await this.tensors(HEAD_REST), num_rest, rank, num_displacements, HEAD_REST);
  }

  /** How a whole person moves. */
  async animation(body: AnyBody): Promise<AnimationInfo> {
    return checkAnimation(parseJson(new TextDecoder().decode(await this.bytes(ANIMATION))), body);
  }

  /** The splats behind the person, if there are some. */
  async backdrop(): Promise<{ name: string; bytes: ArrayBuffer } | null> {
    const name = BACKGROUNDS.find((file) => file in this.promised);
    return name === undefined ? null : { name, bytes: await this.bytes(name) };
  }

  /** The gestures of a body on a skeleton, if there are some. */
  async gestures(): Promise<ArrayBuffer | null> {
    return GESTURES in this.promised ? this.bytes(GESTURES) : null;
  }

  /** What a file holds, by name. */
  async tensors(name: string): Promise<Map<string, Tensor>> {
    return parseSafetensors(await this.bytes(name), name);
  }

  private bytes(name: string): Promise<ArrayBuffer> {
    const coming = this.asked.get(name) ?? this.fetch(name);
    this.asked.delete(name);
    return coming;
  }

  /** What is being fetched, the face before all else; null for nothing. */
  get fetching(): Part | null {
    const parts = new Set([...this.coming].map(partOf));
    return PARTS.find((part) => parts.has(part)) ?? null;
  }

  private async fetch(name: string): Promise<ArrayBuffer> {
    this.coming.add(name);
    try {
      return await this.receive(name);
    } finally {
      this.coming.delete(name);
    }
  }

  private async receive(name: string): Promise<ArrayBuffer> {
    const entry = this.promised[name];
    if (!entry) throw new PageError(`manifest.json does not list ${name}.`);
    const reader = (await get(this.locate(name, entry.sha256), name, this.signal)).body!.getReader();
    const bytes = new Uint8Array(entry.size);
    let at = 0;
    for (let part = await reader.read(); !part.done; part = await reader.read()) {
      if (at + part.value.length > entry.size) {
        reader.cancel().catch(() => {});
        throw new PageError(`${name} is longer than manifest.json says.`);
      }
      bytes.set(part.value, at);
      at += part.value.length;
      this.loaded += part.value.length;
      this.onBytes();
    }
    if (at !== entry.size) throw new PageError(`${name} is shorter than manifest.json says.`);
    await checkHash(bytes, entry.sha256, name);
    return bytes.buffer;
  }
}

function parseJson(text: string): unknown {
  try {
    return parseCalmly(text);
  } catch {
    return null;
  }
}

async function get(address: string, name: string, signal?: AbortSignal): Promise<Response> {
  let response: Response;
  try {
    response = await fetch(address, { signal });
  } catch {
    signal?.throwIfAborted();
    throw new PageError(say('error.unanswered', { name }));
  }
  if (response.status === 401) throw new PageError(say('error.refused'));
  if (!response.ok) throw new PageError(say('error.missing', { name, status: response.status }));
  return response;
}

/** Compares the hash where the browser can compute one (HTTPS and localhost). */
async function checkHash(bytes: Uint8Array<ArrayBuffer>, sha256: string, name: string): Promise<void> {
  if (!globalThis.crypto?.subtle) return;
  const digest = new Uint8Array(await crypto.subtle.digest('SHA-256', bytes));
  const hex = Array.from(digest, (byte) => byte.toString(16).padStart(2, '0')).join('');
  if (hex !== sha256) throw new PageError(say('error.changed', { name }));
}
