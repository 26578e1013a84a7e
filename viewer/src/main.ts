import type { SplatGenerator } from '@sparkjsdev/spark';
import './style.css';
import type { Body } from './body/body.ts';
import type { SkinnedBody } from './body/skinned/body.ts';
import { bytesToFirstSight, loadManifest } from './bundle/load.ts';
import { blinkIndices, bodyOf, type HeadInfo, type Manifest } from './bundle/manifest.ts';
import { makeCast, type Cast } from './cast.ts';
import { PageError, sentenceOf } from './errors.ts';
import { Face } from './face/face.ts';
import { IdleFace } from './face/idle.ts';
import type { Head } from './head/head.ts';
import type { MotionDirector } from './motion/director.ts';
import { readSplats, type Splats } from './stage/readback.ts';
import { Stage } from './stage/stage.ts';
import { socketUrl } from './talk/connection.ts';
import { Conversation } from './talk/conversation.ts';
import { watchCover } from './ui/cover.ts';
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
      skinned?: SkinnedBody;
      director?: MotionDirector;
      conversation?: Conversation;
      splats: (generator: SplatGenerator) => Splats;
    };
  }
}

const CALM = matchMedia('(prefers-reduced-motion: reduce)').matches;
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
  watchCover((pixels) => stage.keepClear(pixels));
  const page = makePage(overlay, () => stage.frames);
  const conversation = manifest.head ? new Conversation(socketUrl(location), page.view) : undefined;
  const { head, body, skinned, playback, director } = await enter(manifest, stage, conversation);
  const moving = body ?? skinned;
  if (moving && playback) new PlayerBar(moving, playback, 1 / bodyOf(manifest)!.fps);

  window.ico3d = { stage, head, body, skinned, director, conversation, splats: (generator) => readSplats(stage, generator) };
  if (head && conversation) {
    head.director = makeFace(manifest.head!, conversation);
    conversation.bodyTime = () => moving?.time ?? 0;
    conversation.gestures = director ?? null;
    await mayTalk(conversation);
  }
  overlay.hide();
  if (conversation) page.talk(conversation);
  else byId('play').focus();
}

/** Brings everybody on stage and waits until they can be seen. */
async function enter(manifest: Manifest, stage: Stage, conversation?: Conversation): Promise<Cast> {
  const total = bytesToFirstSight(manifest);
  let loaded = 0;
  const cast = await makeCast(manifest, stage, CALM, {
    heard: () => conversation?.player.heard() ?? null,
    loaded: (bytes) => overlay.progress(Math.min(1, (loaded += bytes) / total)),
    failed: (error) => showNotice(sentenceOf(error)),
  });
  stage.start();
  await cast.body?.ready();
  return cast;
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
