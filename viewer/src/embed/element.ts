import { loadManifest, THUMBNAIL } from '../bundle/load.ts';
import { PageError, sentenceOf } from '../errors.ts';
import { admit, fromSite } from '../admission.ts';
import { Server } from '../server.ts';
import type { Emit, TalkEvents } from '../talk/events.ts';
import { focusOn } from '../ui/elements.ts';
import { icon } from '../ui/icons.ts';
import { codeOf, english, say, type Sentence } from '../words/text.ts';
import { Overlay, type Choice } from '../ui/overlay.ts';
import { TalkMemory } from '../ui/sheets/kept-talk.ts';
import { followTheme, showTheme } from '../ui/theme.ts';
import type { Presence, Visit } from '../visit.ts';
import { xrSettings } from '../xr/settings.ts';
import { buildShell, fillPage, type Shell } from './shell.ts';

/** Details of the events of `<ico3d-avatar>`, by name. All bubble, through shadow roots too. */
export interface AvatarEvents extends Omit<TalkEvents, 'connected'> {
  /** The avatar is seen and can be talked with. */
  ready: { name: string };
}

/** One connection of an element, from `connect` to `disconnect`. */
interface Talk {
  ending: AbortController;
  ready: Promise<void>;
  visit?: Visit;
  presence?: Presence;
}

/**
 * `<ico3d-avatar server="…" mode="inline|floating" transparent autoconnect>`: an avatar in somebody's page.
 *
 * `draw` says what draws, `webgl` or `soft`; without it the browser decides, and the visitor.
 *
 * `server` is the address of `ico3d serve`, by default that of this module; `avatar` a folder below it;
 * `token` or `token-url` admit the page where the server asks for it.
 */
export class AvatarElement extends HTMLElement {
  static readonly observedAttributes = ['token', 'lang'];
  /** Address of the server of elements without the attribute. */
  static server: string | null = null;
  private readonly shell: Shell;
  private server: Server | null = null;
  private reached = ''; // its address
  private talk: Talk | null = null;
  private invitation: AbortController | null = null;
  private volume = 1;
  private readonly said = new TalkMemory(); // until the element is gone

  constructor() {
    super();
    this.shell = buildShell(this.attachShadow({ mode: 'open' }));
    this.shell.launcher.onclick = () => this.toggle();
  }

  connectedCallback(): void {
    this.show(false);
    if (this.hasAttribute('autoconnect')) this.connect().catch(() => {}); // an event has told it
    else if (!this.floats) void this.invite();
  }

  disconnectedCallback(): void {
    this.end();
  }

  attributeChangedCallback(name: string, _: string | null, value: string | null): void {
    if (name === 'lang') this.shell.words.wish(value);
    else queueMicrotask(() => this.renew());
  }

  /** Gives a new token to the server that it is for, once attributes that change together have changed. */
  private renew(): void {
    if (this.server && this.address()?.href === this.reached) this.server.token = this.getAttribute('token') ?? '';
  }

  /**
   * Loads the avatar and begins to talk; browsers play sound only after a click, for which it asks.
   *
   * @throws Error with one sentence if it does not succeed
   */
  connect(): Promise<void> {
    return this.begin();
  }

  /** Ends the talk and gives everything back. */
  disconnect(): void {
    const inside = this.shell.page.contains(this.shadowRoot!.activeElement);
    this.end();
    this.show(false);
    if (this.floats && inside) this.shell.launcher.focus();
    if (!this.floats && this.isConnected) void this.invite();
  }

  /** Has the avatar say a text as it is, if the server's settings allow it; false while it is not connected. */
  say(text: string): boolean {
    return this.talk?.presence?.conversation?.say(text) ?? false;
  }

  /** Asks what a visitor could have typed; false while it is not connected. */
  send(text: string): boolean {
    return this.talk?.presence?.conversation?.ask(text) ?? false;
  }

  /** Silences the avatar. */
  interrupt(): void {
    this.talk?.presence?.conversation?.interrupt();
  }

  /** Opens or closes the visitor's microphone, for which browsers ask. */
  async setMic(open: boolean): Promise<void> {
    await this.talk?.presence?.conversation?.setMicrophone(open);
  }

  /** @param volume from 0 to 1 */
  setVolume(volume: number): void {
    this.volume = volume;
    this.applyVolume();
  }

  /**
   * Enters VR or AR.
   *
   * @throws Error with one sentence where that is not possible
   */
  async enterXR(): Promise<void> {
    const enter = this.talk?.presence?.stage.enterXr;
    if (!enter) throw new PageError(say('error.xr'));
    await enter();
  }

  private get floats(): boolean {
    return this.getAttribute('mode') === 'floating';
  }

  private toggle(): void {
    if (this.talk) return this.disconnect();
    this.connect().catch(() => {}); // an event has told it
    this.shell.page.focus();
  }

  private show(open: boolean): void {
    this.toggleAttribute('open', open && this.floats);
    this.shell.launcher.setAttribute('aria-expanded', String(open));
    this.shell.launcher.replaceChildren(icon(open ? 'close' : 'talk'));
  }

  /** Fills the page anew; the focus stays within. */
  private refill(): void {
    focusOn(this.shell.page);
    fillPage(this.shell, this.address());
  }

  /** Shows who is there, and loads them when the visitor wants to talk. */
  private async invite(): Promise<void> {
    const { signal } = (this.invitation = new AbortController());
    this.refill();
    followTheme(this.shell.page, () => {}, signal);
    const overlay = new Overlay(this.shell.page, this.shell.words, signal, () => this.disconnect());
    try {
      const server = await this.reach(signal);
      const manifest = await loadManifest((name) => server.file(name), signal);
      overlay.greet(manifest, server.file(THUMBNAIL));
      const choice = await overlay.choose();
      if (!signal.aborted) this.begin(choice).catch(() => {}); // an event has told it
    } catch (error) {
      if (!signal.aborted) this.fail(error, overlay);
    }
  }

  /** The server of the attributes, which admits this page. */
  private async reach(signal: AbortSignal): Promise<Server> {
    const address = this.address();
    if (!address) throw new PageError(say('error.address'));
    this.server = new Server(address);
    this.reached = address.href;
    this.server.token = this.getAttribute('token') ?? this.server.token;
    const tokens = this.getAttribute('token-url');
    if (tokens) await admit(this.server, fromSite(new URL(tokens, document.baseURI).href), say('error.token'), signal);
    return this.server;
  }

  /** Where the page of the avatar is; null where no attribute tells it, or one names what no server is. */
  private address(): URL | null {
    const server = this.getAttribute('server') ?? AvatarElement.server;
    if (server === null || !URL.canParse(server, document.baseURI)) return null;
    if (!/^https?:$/.test(new URL(server, document.baseURI).protocol)) return null;
    const folder = (address: string) => (address.endsWith('/') ? address : `${address}/`);
    const base = new URL(folder(server), document.baseURI);
    const avatar = this.getAttribute('avatar');
    return avatar ? new URL(folder(encodeURIComponent(avatar)), base) : base;
  }

  private begin(choice?: Choice): Promise<void> {
    if (this.talk) return this.talk.ready;
    this.invitation?.abort();
    const talk: Talk = { ending: new AbortController(), ready: Promise.resolve() };
    this.talk = talk;
    this.refill();
    showTheme(this.shell.page); // what draws is still to be fetched
    this.show(true);
    talk.ready = this.open(talk, choice);
    return talk.ready;
  }

  /** Resolves when the avatar can be talked with. */
  private async open(talk: Talk, choice?: Choice): Promise<void> {
    const { signal } = talk.ending;
    try {
      const [{ Visit }, server] = await Promise.all([import('../visit.ts'), this.reach(signal)]);
      signal.throwIfAborted();
      await new Promise<void>((resolve, reject) => {
        signal.addEventListener('abort', () => reject(signal.reason));
        talk.visit = new Visit(this.shell.page, server, this.ports(talk, choice, resolve, reject));
      });
    } catch (error) {
      if (signal.aborted) throw new PageError(say('error.disconnected'));
      if (!talk.visit) this.fail(error, new Overlay(this.shell.page, this.shell.words, signal, () => this.restart()));
      throw error;
    }
  }

  private ports(talk: Talk, choice: Choice | undefined, ready: () => void, failed: (error: Error) => void) {
    let name = '';
    let isReady = false;
    const tell = () => {
      if (isReady) return;
      isReady = true;
      this.applyVolume();
      this.dispatch('ready', { name });
      ready();
    };
    const emit: Emit = (event, detail) => (event === 'connected' ? tell() : this.dispatch(event, detail as never));
    return {
      words: this.shell.words,
      transparent: this.hasAttribute('transparent'),
      choice,
      draw: this.getAttribute('draw'),
      xr: xrSettings((name) => this.getAttribute(name)),
      emit,
      named: (given: string) => void (name = given),
      entered: (presence: Presence) => {
        talk.presence = presence;
        if (!presence.conversation) tell(); // a body alone only moves
      },
      failed: (sentence: Sentence) => {
        this.tell(sentence);
        failed(new PageError(sentence));
      },
      reload: () => this.restart(),
      keeps: (home: string, avatar: string) => this.said.of(home, avatar), // the storage of the page around is not ours
    };
  }

  private applyVolume(): void {
    const conversation = this.talk?.presence?.conversation;
    if (conversation) conversation.volume = this.volume;
  }

  private restart(): void {
    this.end();
    this.begin().catch(() => {}); // an event has told it
  }

  private end(): void {
    this.invitation?.abort();
    this.talk?.visit?.dispose();
    this.talk?.ending.abort();
    this.talk?.ready.catch(() => {}); // nobody may wait for it
    this.talk = null;
  }

  private fail(error: unknown, overlay: Overlay): void {
    if (!(error instanceof PageError)) console.error(error);
    overlay.fail(sentenceOf(error));
    this.tell(sentenceOf(error));
  }

  private tell(sentence: Sentence): void {
    this.dispatch('error', { message: english(sentence), code: codeOf(sentence), fatal: true });
  }

  private dispatch<K extends keyof AvatarEvents>(name: K, detail: AvatarEvents[K]): void {
    this.dispatchEvent(new CustomEvent(name, { detail, bubbles: true, composed: true }));
  }
}

/** All events of the element, with those that every element has. */
type ElementEvents = Omit<HTMLElementEventMap, keyof AvatarEvents> & { [K in keyof AvatarEvents]: CustomEvent<AvatarEvents[K]> };

type Options = boolean | AddEventListenerOptions;

export interface AvatarElement {
  addEventListener<K extends keyof ElementEvents>(type: K, listener: (event: ElementEvents[K]) => unknown, options?: Options): void;
  addEventListener(type: string, listener: EventListenerOrEventListenerObject, options?: Options): void;
  removeEventListener<K extends keyof ElementEvents>(type: K, listener: (event: ElementEvents[K]) => unknown, options?: Options): void;
  removeEventListener(type: string, listener: EventListenerOrEventListenerObject, options?: Options): void;
}

declare global {
  interface HTMLElementTagNameMap {
    'ico3d-avatar': AvatarElement;
  }
}

/** Makes `<ico3d-avatar>` known to the browser, once. */
export function defineAvatar(): void {
  if (!customElements.get('ico3d-avatar')) customElements.define('ico3d-avatar', AvatarElement);
}
