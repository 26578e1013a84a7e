import { PageError } from '../errors.ts';
import type { Server } from '../server.ts';
import { parseCalmly } from '../words/calm.ts';
import { isKey, say, type Key, type Message } from '../words/text.ts';
import { adviceOf, together, type Advice } from './advice.ts';

/** One part of a recording, as the server tells it. */
export interface Part {
  id: string;
  text: string;
  state: 'missing' | 'broken' | 'kept';
  take?: string; // of a part that broke off
  seconds?: number;
  advice?: (Advice | string)[];
}

/** What a part is called on the page. */
export function partName(id: string): Message {
  const number = /^text-(\d+)$/.exec(id)?.[1];
  return number ? say('studio.part.text', { n: Number(number) }) : say(`studio.part.${id}` as Key);
}

/** Ways to turn the head. */
export const TURNS = ['left', 'right', 'up', 'down'] as const;
export type Turns = Record<(typeof TURNS)[number], number>;

/** How far an avatar is. */
export interface Making {
  state: 'running' | 'stopped' | 'failed' | 'made';
  quality: string;
  step: string;
  share: number;
  left: number | null; // s
  advice: (Advice | string)[];
  refused: Advice[]; // why nothing can be made of the video
  faces: number; // pictures of the face so far
  error: string; // why it failed, in English
  code?: string; // of what happened, if somebody foresaw it; earlier versions had none
  values?: Record<string, string | number>; // what stands in its sentence
  decibels: number | null;
  changed: ('parts' | 'on')[]; // what is another since: the recordings, the body
}

/** Which body an avatar gets. */
export interface Body {
  wanted: boolean; // else it is a head with shoulders
  build: string;
  outfit: string;
}

/** Everything about one person. */
export interface Status {
  name: string;
  language: string;
  parts: Part[];
  covered: { seconds: number; enough: number; turns: Turns; sounds: number; of_sounds: number };
  making: Making | null;
  body: Body;
  avatar: boolean;
  durations: Record<string, number>; // s that each quality takes; empty as long as nobody knows
}

/** Who is recorded, and what the server can do. */
export interface Overview {
  people: string[];
  consent: Record<string, string>;
  qualities: string[];
  builds: string[];
  outfits: string[];
  packaged: boolean; // whether the body is that of the packaged avatar, of which there are pictures
  lacking: string; // why there is no face tracker
  voice: Record<string, string>; // agreed to besides, if the voice may be cloned; empty where nobody is asked
  mute: boolean; // whether the server lacks what clones voices
}

/** What is told of a picture of the camera. */
export interface Told {
  word: string;
  turned: Turns | null;
}

/** The server refused something; `status` is that of HTTP, 0 where it did not answer. */
export class Refusal extends PageError {
  readonly status: number;

  constructor(status: number, code: string, text: string, advice: readonly Advice[] = []) {
    const key = `studio.refused.${code}`;
    const values = advice.length > 0 ? { why: together(advice.map(adviceOf)) } : undefined;
    super(status === 0 ? say('studio.lost') : isKey(key) ? say(key, values) : text);
    this.status = status;
  }
}

/** The recordings of a server: each call is one request, and throws a `Refusal`. */
export class Recordings {
  private readonly server: Server;

  constructor(server: Server) {
    this.server = server;
  }

  overview(): Promise<Overview> {
    return this.ask('GET', '');
  }

  begin(name: string, language: string, agreed: boolean, voice: boolean): Promise<Status> {
    return this.ask('POST', at(name), JSON.stringify({ language, agreed, voice }));
  }

  status(name: string): Promise<Status> {
    return this.ask('GET', at(name));
  }

  delete(name: string): Promise<void> {
    return this.ask('DELETE', at(name));
  }

  append(name: string, part: string, take: string, offset: number, data: Blob): Promise<{ size: number }> {
    return this.ask('POST', at(name, 'takes', part, take), data, { offset: String(offset) });
  }

  keep(name: string, part: string, take: string): Promise<Status> {
    return this.ask('POST', at(name, 'takes', part, take, 'keep'));
  }

  remove(name: string, part: string): Promise<Status> {
    return this.ask('DELETE', at(name, 'parts', part));
  }

  look(name: string, part: string, picture: Blob): Promise<Told> {
    return this.ask('POST', at(name, 'look'), picture, { part });
  }

  choose(name: string, body: Body): Promise<Status> {
    return this.ask('PUT', at(name, 'body'), JSON.stringify(body));
  }

  make(name: string, quality: string, anew = false): Promise<Status> {
    return this.ask('POST', at(name, 'making'), JSON.stringify({ quality, anew }));
  }

  halt(name: string): Promise<Status> {
    return this.ask('DELETE', at(name, 'making'));
  }

  discard(name: string): Promise<Status> {
    return this.ask('DELETE', at(name, 'making'), undefined, { discard: 'true' });
  }

  talk(name: string): Promise<{ url: string }> {
    return this.ask('POST', at(name, 'talk'));
  }

  /** Address of a part's video. */
  video(name: string, part: string): string {
    return this.server.recordings(at(name, 'parts', part), { at: String(Date.now()) });
  }

  /** Address of the picture of the face as it learns. */
  face(name: string, number: number): string {
    return this.server.recordings(at(name, 'making', 'face'), { number: String(number) });
  }

  private async ask<Answer>(method: string, path: string, body?: BodyInit, values?: Record<string, string>): Promise<Answer> {
    const response = await fetch(this.server.recordings(path, values), { method, body, cache: 'no-store' }).catch(() => null);
    if (response === null) throw new Refusal(0, '', '');
    if (response.status === 204) return undefined as Answer;
    const answer = (await told(response)) as Answer & { code?: string; error?: string; advice?: Advice[] };
    if (response.ok) return answer;
    throw new Refusal(response.status, answer.code ?? '', answer.error ?? `${response.status} ${response.statusText}`, answer.advice);
  }
}

/** What an answer says, of which much may stand in a folder that somebody brought; nothing where it is no JSON. */
async function told(response: Response): Promise<unknown> {
  try {
    return parseCalmly(await response.text());
  } catch {
    return {};
  }
}

function at(...names: string[]): string {
  return names.map(encodeURIComponent).join('/');
}
