import './style.css';
import { blinkIndices } from './bundle/manifest.ts';
import { loadBundle, loadManifest } from './bundle/load.ts';
import { PageError, sentenceOf } from './errors.ts';
import { Face } from './face/face.ts';
import { IdleFace } from './face/idle.ts';
import { readAttributes } from './stage/readback.ts';
import { Stage } from './stage/stage.ts';
import { socketUrl } from './talk/connection.ts';
import { Conversation } from './talk/conversation.ts';
import { byId } from './ui/elements.ts';
import { Overlay } from './ui/overlay.ts';
import { makePage } from './ui/page.ts';

declare global {
  interface Window {
    /** For tests and for the curious: what the page is made of. */
    ico3d?: { stage: Stage; conversation: Conversation; attributes: () => Float32Array };
  }
}

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
  const bundle = await loadBundle(manifest, (fraction) => overlay.progress(fraction));

  const still = matchMedia('(prefers-reduced-motion: reduce)').matches;
  const stage = new Stage(byId<HTMLCanvasElement>('stage'), bundle, !still);
  const { view, controls } = makePage(overlay, () => stage.frames);
  const conversation = new Conversation(socketUrl(location), view);
  conversation.bodyTime = () => stage.bodyTime;
  controls.bind(conversation);

  const idle = new IdleFace(Float32Array.from(manifest.head.idle_expression), blinkIndices(manifest.head));
  stage.start(new Face(manifest.head.expression_size, idle, () => conversation.player.heard()));
  window.ico3d = { stage, conversation, attributes: () => readAttributes(stage) };

  const { context } = conversation.player;
  if (context.state !== 'running') {
    const choice = await overlay.choose();
    await context.resume();
    if (choice === 'voice') void conversation.toggleMicrophone();
  }
  overlay.hide();
  byId('text').focus();
  conversation.start();
}

function cssColour(rgb: readonly number[]): string {
  return `rgb(${rgb.map((value) => Math.round(255 * value)).join(' ')})`;
}
