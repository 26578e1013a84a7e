/** What can fail between a click on the microphone and its first sound, in this order. */
export const STEPS = [
  'permission',
  'track', // the stream has none
  'context',
  'module',
  'source',
  'node',
  'connection',
  'resume',
  'sound',
] as const;

export type Step = (typeof STEPS)[number];

/** A browser's microphone and audio graph that do and fail what the test wants. */
export class ScriptedAudio {
  fault: Step | null = null;
  /** Who waits for the visitor's permission; `allow` or `deny` answers the first. */
  readonly prompts: { allow(): void; deny(name: string): void }[] = [];
  readonly streams: ScriptedStream[] = [];
  readonly contexts: ScriptedContext[] = [];
  readonly nodes: ScriptedNode[] = [];

  /** What is connected; `plug` changes it. */
  private inputs = [{ kind: 'audioinput', deviceId: 'default', groupId: 'built in' }];
  private readonly devices = Object.assign(new EventTarget(), {
    getUserMedia: () => this.ask(),
    enumerateDevices: async () => this.inputs,
  });
  /** How often the screen was kept on, and whether it is. */
  readonly wake = { asked: 0, held: false };
  /** What the browser says of the page's permission; a test changes it, and tells so. */
  readonly permission = Object.assign(new EventTarget(), { state: 'prompt' });
  readonly page = Object.assign(new EventTarget(), { visibilityState: 'visible' });

  /** What stands for the browser's own classes, `navigator` and `document`. */
  readonly globals: Record<string, unknown>;

  constructor() {
    const audio = this;
    this.globals = {
      navigator: { mediaDevices: this.devices, permissions: { query: async () => this.permission }, wakeLock: { request: async () => this.lock() } },
      document: this.page,
      AudioContext: class extends ScriptedContext {
        constructor(options?: object) {
          super(audio, options !== undefined);
        }
      },
      GainNode: ScriptedNode,
      MediaStreamAudioSourceNode: class extends ScriptedNode {
        constructor(_: unknown, { mediaStream }: { mediaStream: ScriptedStream }) {
          audio.step('source');
          if (mediaStream.tracks.length === 0) throw new DOMException('scripted', 'InvalidStateError');
          super();
        }
        override connect<T>(next: T): T {
          audio.step('connection');
          return next;
        }
      },
      AudioWorkletNode: class extends ScriptedNode {
        constructor() {
          audio.step('node');
          super();
          audio.nodes.push(this);
        }
      },
    };
  }

  /** Another device becomes the system's default. */
  plug(groupId: string): void {
    this.inputs = [{ kind: 'audioinput', deviceId: 'default', groupId }];
    this.devices.dispatchEvent(new Event('devicechange'));
  }

  /** The page is looked at, or not any more; then browsers give up the lock on the screen. */
  look(visible: boolean): void {
    this.page.visibilityState = visible ? 'visible' : 'hidden';
    if (!visible) this.wake.held = false;
    this.page.dispatchEvent(new Event('visibilitychange'));
  }

  /** Whether the browser shows that it records. */
  get records(): boolean {
    return this.streams.some(({ tracks }) => tracks.some(({ readyState }) => readyState === 'live'));
  }

  /** Contexts of microphones that are not closed. */
  get running(): number {
    return this.contexts.filter(({ ofPlayer, state }) => !ofPlayer && state !== 'closed').length;
  }

  /** 32 ms of sound leave the worklet. */
  sounds(pcm = new Int16Array(512)): void {
    const data = { pcm, end: this.contexts.at(-1)!.currentTime };
    if (this.fault !== 'sound') this.nodes.at(-1)?.port.onmessage?.({ data });
  }

  step(step: Step): void {
    if (this.fault === step) throw new DOMException('scripted', 'InvalidStateError');
  }

  private lock(): { released: boolean; release(): Promise<void> } {
    const { wake } = this;
    wake.asked++;
    wake.held = true;
    return {
      get released() {
        return !wake.held;
      },
      release: async () => void (wake.held = false),
    };
  }

  private ask(): Promise<ScriptedStream> {
    return new Promise((resolve, reject) => {
      const allow = () => {
        const stream = new ScriptedStream(this.fault === 'track' ? 0 : 1);
        this.streams.push(stream);
        resolve(stream);
      };
      this.prompts.push({ allow, deny: (name) => reject(new DOMException('scripted', name)) });
    });
  }
}

class ScriptedTrack {
  readyState = 'live';
  onended: (() => void) | null = null;

  stop(): void {
    this.readyState = 'ended';
  }

  /** The device is pulled out. */
  vanish(): void {
    this.readyState = 'ended';
    this.onended?.();
  }
}

class ScriptedStream {
  readonly tracks: ScriptedTrack[];

  constructor(count: number) {
    this.tracks = Array.from({ length: count }, () => new ScriptedTrack());
  }

  getTracks(): ScriptedTrack[] {
    return this.tracks;
  }

  getAudioTracks(): ScriptedTrack[] {
    return this.tracks;
  }
}

class ScriptedContext {
  readonly ofPlayer: boolean;
  readonly destination = {};
  readonly baseLatency = 0;
  currentTime = 0;
  state = 'running';
  resumed = 0; // times
  onstatechange: (() => void) | null = null;
  private readonly audio: ScriptedAudio;

  constructor(audio: ScriptedAudio, ofPlayer: boolean) {
    this.audio = audio;
    this.ofPlayer = ofPlayer;
    if (!ofPlayer) audio.step('context');
    audio.contexts.push(this);
  }

  readonly audioWorklet = { addModule: async () => this.audio.step('module') };

  async resume(): Promise<void> {
    this.audio.step('resume');
    this.resumed++;
  }

  async close(): Promise<void> {
    if (this.state === 'closed') throw new DOMException('scripted', 'InvalidStateError');
    this.state = 'closed';
  }
}

class ScriptedNode {
  readonly port: { onmessage: ((event: { data: object }) => void) | null } = { onmessage: null };
  onprocessorerror: (() => void) | null = null;

  connect<T>(next: T): T {
    return next;
  }
}
