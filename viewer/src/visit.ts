import { admit, byKey } from './admission.ts';
import type { Body } from './body/body.ts';
import type { SkinnedBody } from './body/skinned/body.ts';
import { BundleFiles, filesToFirstSight, identityOf, loadManifest, THUMBNAIL } from './bundle/load.ts';
import { blinkIndices, bodyOf, nameOf, type HeadInfo, type Manifest } from './bundle/manifest.ts';
import type { Cast } from './cast.ts';
import { PageError, sentenceOf } from './errors.ts';
import { Face } from './face/face.ts';
import { IdleFace } from './face/idle.ts';
import { atEnd } from './lifetime.ts';
import type { Server } from './server.ts';
import { PAINTERS } from './painters/paths.ts';
import { choosePath, rememberWish, wishOf, type Wish } from './stage/choosing.ts';
import type { Drawing } from './stage/painting.ts';
import type { Stage } from './stage/stage.ts';
import { Conversation, type ConversationView } from './talk/conversation.ts';
import type { Emit } from './talk/events.ts';
import { telling } from './talk/telling.ts';
import { watchCover } from './ui/cover.ts';
import { byId, focusOn } from './ui/elements.ts';
import { Overlay, type Choice } from './ui/overlay.ts';
import { makePage, showNotice, type Page } from './ui/page.ts';
import { PlayerBar } from './ui/player.ts';
import { offerDrawing } from './ui/sheets/drawing.ts';
import type { TalkStore } from './ui/sheets/kept-talk.ts';
import { showOrigin } from './ui/sheets/origin.ts';
import { makeThemeButton, showTheme } from './ui/theme.ts';
import type { PageWords } from './words/page-words.ts';
import { codeOf, say, type Sentence } from './words/text.ts';
import { offerXr } from './xr/offer.ts';
import type { Path } from './soft/contract.ts';
import { xrSettings, type XrSettings } from './xr/settings.ts';

/** States of a conversation in which an answer is worked out. */
const AT_WORK: ReadonlySet<string> = new Set(['listening', 'thinking']);

/** Who is there, once they can be seen. */
export interface Presence extends Cast {
  stage: Stage;
  conversation?: Conversation; // none of a body alone
}

/** What is wrong where a key helps. */
const LOCKED = new Set<string>(['error.refused', 'error.key']);

type Theatre = typeof import('./theatre.ts');

/** What a visit needs of the page around it. */
export interface VisitPorts {
  /** The words of the page. */
  words: PageWords;
  /** The avatar alone is drawn, on what is behind the element. */
  transparent?: boolean;
  /** What is to draw: `webgl`, `soft` or `auto`; null where that is the visitor's choice. */
  draw?: string | null;
  /** How the visitor wants to talk, if it is known. */
  choice?: Choice;
  /** What headsets draw. */
  xr?: XrSettings;
  /** Takes what happens in the conversation. */
  emit: Emit;
  /** The avatar's name is known. */
  named(name: string): void;
  /** Everybody can be seen; nobody talks yet. */
  entered(presence: Presence): void;
  /** The avatar cannot be shown. */
  failed?(sentence: Sentence): void;
  /** Loads everything anew, where nothing else helps. */
  reload(): void;
  /** The server's key, if the visitor has one. */
  key?: string | null;
  /** Tries a key that the visitor types; only where he may have one. */
  unlock?(key: string): void;
  /** Gives where what was said stays once a talk is over, by the server's address and what tells avatars apart. */
  keeps(home: string, avatar: string): TalkStore;
}

/**
 * A visit to an avatar: loads it, shows it and talks, in one element and without a trace outside of it.
 *
 * Several visits may be on one page, each in an element of its own.
 */
export class Visit {
  private readonly root: HTMLElement;
  private readonly server: Server;
  private readonly ports: VisitPorts;
  private readonly calm = matchMedia('(prefers-reduced-motion: reduce)').matches;
  private readonly ending = new AbortController();
  private readonly overlay: Overlay;
  private redrawing = Promise.resolve(); // one after another

  /** @param root what holds the elements of `index.html` */
  constructor(root: HTMLElement, server: Server, ports: VisitPorts) {
    this.root = root;
    this.server = server;
    this.ports = ports;
    showTheme(root); // until there is a button: who waits, or reads of an error, is not dazzled either
    this.overlay = new Overlay(root, ports.words, this.ending.signal, () => ports.reload());
    for (const id of ['check', 'help-check']) byId<HTMLAnchorElement>(root, id).href = server.check();
    this.run().catch((error: unknown) => this.fail(error));
  }

  /** Ends everything that the visit began: sound, connection, picture and listeners. */
  dispose(): void {
    this.ending.abort();
  }

  private async run(): Promise<void> {
    const { root, server } = this;
    const { words } = this.ports;
    const { signal } = this.ending;
    const coming = import('./theatre.ts'); // meanwhile the first files are asked for
    coming.catch(() => {}); // heard of below
    const told = this.loadManifest();
    const wish = wishOf(this.ports.draw);
    const drawing = drawingOf(wish);
    drawing.catch(() => {}); // heard of below
    const manifest = await told;
    const files = this.ask(manifest);
    const name = nameOf(manifest);
    byId(root, 'name').textContent = name;
    root.style.setProperty('--backdrop', cssColour(manifest.background));
    showOrigin(root, words, manifest.provenance, signal);
    this.overlay.greet(manifest, server.file(THUMBNAIL, manifest.files[THUMBNAIL]?.sha256));
    this.ports.named(name);

    const theatre = await coming;
    signal.throwIfAborted();
    const stage = new theatre.Stage(byId<HTMLCanvasElement>(root, 'stage'), manifest, await drawing, this.ports.transparent);
    atEnd(signal, () => stage.dispose());
    let offered = () => {}; // says anew what headsets may do
    stage.onGone = () => void this.goOnWithoutWebGL(stage).then(() => offered());
    stage.onSeen = () => (root.dataset.there = '');
    root.dataset.path = stage.painter.path;
    watchCover(root, signal, stage.keepClear.bind(stage));
    const home = server.home();
    const { languages = [], suggestions = [] } = manifest.persona;
    const talker = { name, languages, suggestions, home, kept: this.ports.keeps(home, identityOf(manifest)) };
    const page = makePage(root, words, talker, this.overlay, () => stage.figures, signal);
    const conversation = manifest.head ? this.converse(page, stage) : undefined;
    const presence: Presence = { stage, conversation, ...(await this.enter(theatre, manifest, files, stage, conversation)) };
    const corner = root.querySelector<HTMLElement>('.figures')!;
    corner.append(
      makeThemeButton(root, words, (light) => stage.setBright(light), signal),
      theatre.makeViewBar(stage.orbit, words, root, signal),
    );
    const settings = this.ports.xr ?? xrSettings(() => null);
    const xr = { stage, conversation, head: presence.head, root, words, settings, begin: () => this.overlay.accept('voice'), signal };
    offered = offerXr(corner, xr, (sentence) => showNotice(root, words, sentence));
    offerDrawing(root, wish, (wish) => void this.redraw(stage, wish).then(offered));
    const { playback } = presence;
    const moving = presence.body ?? presence.skinned;
    if (moving && playback) new PlayerBar(root, words, moving, playback, 1 / bodyOf(manifest)!.fps, signal);
    this.ports.entered(presence);
    if (conversation) await this.prepare(conversation, presence, manifest.head!, moving);
    this.overlay.hide();
    if (conversation) page.talk(conversation);
    else focusOn(byId(root, 'play'));
  }

  private async loadManifest(): Promise<Manifest> {
    const { server, ports } = this;
    const { signal } = this.ending;
    if (ports.key) await admit(server, byKey(server, ports.key), say('error.key'), signal);
    return loadManifest(server.file.bind(server), signal);
  }

  /** Something else is to draw from now on; the talk goes on. */
  private redraw(stage: Stage, wish: Wish): Promise<void> {
    rememberWish(wish);
    const next = async () => {
      const drawing = await drawingOf(wish);
      if (!this.ending.signal.aborted && drawing.path !== stage.painter.path) await this.change(stage, drawing);
    };
    return (this.redrawing = this.redrawing.then(next).catch((error: unknown) => {
      if (!this.ending.signal.aborted) showNotice(this.root, this.ports.words, sentenceOf(error));
    }));
  }

  /** The browser took WebGL away: the processor draws from now on. */
  private goOnWithoutWebGL(stage: Stage): Promise<void> {
    const next = async () => {
      const make = await PAINTERS.soft();
      if (!this.ending.signal.aborted) await this.change(stage, { make, why: say('drawn.gone') });
    };
    return (this.redrawing = this.redrawing.then(next).catch((error: unknown) => {
      if (this.ending.signal.aborted) return;
      console.error(error);
      this.overlay.fail(say('error.picture'));
    }));
  }

  private async change(stage: Stage, drawing: Drawing): Promise<void> {
    await stage.redraw(drawing);
    this.root.dataset.path = stage.painter.path;
  }

  private converse(page: Page, stage: Stage): Conversation {
    const state: ConversationView['state'] = (state) => {
      page.view.state(state);
      stage.spare(AT_WORK.has(state));
    };
    const view = telling(Object.assign(Object.create(page.view) as ConversationView, { state }), this.ports.emit);
    const conversation = new Conversation(() => this.server.socket(), view, this.ports.emit);
    atEnd(this.ending.signal, () => conversation.dispose());
    return conversation;
  }

  /** Asks for the files without which there is nobody to see. */
  private ask(manifest: Manifest): BundleFiles {
    const first = filesToFirstSight(manifest, this.ports.transparent);
    const window = manifest.head && manifest.body?.windows[0]!.file; // the first to come is about as large
    const total = [...first, ...(window ? [window] : [])].reduce((sum, name) => sum + manifest.files[name]!.size, 0);
    const more = () => this.overlay.progress(Math.min(1, files.loaded / total), files.fetching);
    const files: BundleFiles = new BundleFiles(this.server.file.bind(this.server), manifest.files, more, this.ending.signal);
    files.ask(first);
    return files;
  }

  /** Brings everybody on stage and waits until they can be seen. */
  private async enter(theatre: Theatre, manifest: Manifest, files: BundleFiles, stage: Stage, conversation?: Conversation): Promise<Cast> {
    const { signal } = this.ending;
    const failed = (error: unknown) => signal.aborted || showNotice(this.root, this.ports.words, sentenceOf(error));
    const heard = () => conversation?.player.heard() ?? null;
    const cast = await theatre.makeCast(manifest, files, stage, this.calm, { heard, failed });
    signal.throwIfAborted();
    stage.start();
    await cast.body?.ready();
    stage.bytes = files.loaded;
    signal.throwIfAborted();
    void theatre.refine(manifest, files, cast).catch(failed);
    return cast;
  }

  /** Joins the conversation to who is on stage, and waits until sound may play. */
  private async prepare(
    conversation: Conversation,
    { head, eyes, director, acting }: Presence,
    info: HeadInfo,
    moving?: Body | SkinnedBody,
  ): Promise<void> {
    head!.director = makeFace(info, conversation);
    conversation.bodyTime = () => moving?.time ?? 0;
    conversation.gestures = director ?? null;
    conversation.acting = acting?.language ?? null;
    conversation.eyes = eyes ?? null;
    await this.mayTalk(conversation);
    this.ending.signal.throwIfAborted();
  }

  /** Waits for the click without which browsers play no sound. */
  private async mayTalk(conversation: Conversation): Promise<void> {
    const { context } = conversation.player;
    const allowed = context.state === 'running';
    const choice = allowed ? this.ports.choice : await this.overlay.choose(this.aroundHer());
    if (!allowed) await context.resume();
    if (choice === 'voice') void conversation.toggleMicrophone();
  }

  /** The picture, and the buttons at its edge that need no talk. */
  private aroundHer(): HTMLElement[] {
    return [byId(this.root, 'stage'), this.root.querySelector('header')!];
  }

  private fail(error: unknown): void {
    if (this.ending.signal.aborted) return;
    if (!(error instanceof PageError)) console.error(error);
    const sentence = sentenceOf(error);
    const { unlock } = this.ports;
    if (unlock && LOCKED.has(codeOf(sentence))) this.overlay.askKey(sentence, unlock);
    else this.overlay.fail(sentence);
    this.ports.failed?.(sentence);
  }
}

/** What draws by a wish. */
async function drawingOf(wish: Wish): Promise<Drawing & { path: Path }> {
  const { path, why } = choosePath(wish);
  return { path, why, make: await PAINTERS[path]() };
}

function makeFace(info: HeadInfo, conversation: Conversation): Face {
  const idle = new IdleFace(Float32Array.from(info.idle_expression), blinkIndices(info));
  return new Face(info.expression_size, idle, () => conversation.player.heard());
}

function cssColour(rgb: readonly number[]): string {
  return `rgb(${rgb.map((value) => Math.round(255 * value)).join(' ')})`;
}
