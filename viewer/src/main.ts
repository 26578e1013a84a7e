import type { SplatGenerator } from '@sparkjsdev/spark';
import './style.css';
import { Body } from './body/body.ts';
import { readBakedWindow } from './body/window.ts';
import { loadFile, loadHead, loadManifest } from './bundle/load.ts';
import { blinkIndices, type BodyInfo, type HeadInfo, type Manifest } from './bundle/manifest.ts';
import { parseSafetensors } from './bundle/safetensors.ts';
import { PageError, sentenceOf } from './errors.ts';
import { Face } from './face/face.ts';
import { IdleFace } from './face/idle.ts';
import { Head } from './head/head.ts';
import { readSplats, type Splats } from './stage/readback.ts';
import { Stage } from './stage/stage.ts';
import { socketUrl } from './talk/connection.ts';
import { Conversation } from './talk/conversation.ts';
import { byId } from './ui/elements.ts';
import { Overlay } from './ui/overlay.ts';
import { makePage, showNotice } from './ui/page.ts';
import { PlayerBar } from './ui/player.ts';

declare global {
  interface Window {
    /** For tests and for the curious: what the page is made of. */
    ico3d?: {
      stage: Stage;
      head?: Head;
      body?: Body;
      conversation?: Conversation;
      splats: (generator: SplatGenerator) => Splats;
    };
  }
}

const STILL = matchMedia('(prefers-reduced-motion: reduce)').matches;
const overlay = new Overlay();
run().catch((error: unknown) => {
  if (!(error instanceof PageError)) console.error(error);
  overlay.fail(sentenceOf(error));
});

async function run(): Promise<void> {
  const manifest = await loadManifest();
  const name = manifest.persona.name || manifest.name;
  document.title = byId('name').textContent = name;
  document.documentElement.style.setProperty('--backdrop', cssColour(manifest.background));
  overlay.greet(name);

  const stage = new Stage(byId<HTMLCanvasElement>('stage'), manifest);
  const head = manifest.head ? await makeHead(manifest, manifest.head) : undefined;
  const body = manifest.body ? makeBody(manifest, manifest.body, stage) : undefined;
  for (const actor of [head, body]) if (actor) stage.add(actor);
  const page = makePage(overlay, () => stage.frames);
  stage.start();
  await body?.ready();

  const conversation = head && new Conversation(socketUrl(location), page.view);
  window.ico3d = { stage, head, body, conversation, splats: (generator) => readSplats(stage, generator) };
  if (head && conversation) {
    conversation.bodyTime = () => body?.playback.time ?? head.bodyTime;
    head.director = makeFace(manifest.head!, conversation);
    await mayTalk(conversation);
  }
  overlay.hide();
  if (conversation) page.talk(conversation);
  else byId('play').focus();
}

async function makeHead(manifest: Manifest, info: HeadInfo): Promise<Head> {
  return new Head(await loadHead(manifest, info, (fraction) => overlay.progress(fraction)), !STILL);
}

/** A body whose windows come from the server as they are needed. */
function makeBody(manifest: Manifest, info: BodyInfo, stage: Stage): Body {
  const load = async (index: number) => {
    const window = info.windows[index]!;
    const file = await loadFile(manifest, window.file, progressOf(manifest, window.file));
    return readBakedWindow(parseSafetensors(file, window.file), info, window);
  };
  const body = new Body(info, !STILL, stage.spark, { load, failed: (error) => showNotice(sentenceOf(error)) });
  new PlayerBar(body, 1 / info.fps);
  return body;
}

/** Counts the bytes of a file on the overlay's bar. */
function progressOf(manifest: Manifest, file: string): (bytes: number) => void {
  let loaded = 0;
  return (bytes) => overlay.progress((loaded += bytes) / manifest.files[file]!.size);
}

function makeFace(info: HeadInfo, conversation: Conversation): Face {
  const idle = new IdleFace(Float32Array.from(info.idle_expression), blinkIndices(info));
  return new Face(info.expression_size, idle, () => conversation.player.heard());
}

/** Waits for the click without which browsers play no sound. */
async function mayTalk(conversation: Conversation): Promise<void> {
  const { context } = conversation.player;
  if (context.state === 'running') return;
  const choice = await overlay.choose();
  await context.resume();
  if (choice === 'voice') void conversation.toggleMicrophone();
}

function cssColour(rgb: readonly number[]): string {
  return `rgb(${rgb.map((value) => Math.round(255 * value)).join(' ')})`;
}
