import { PageError } from '../errors.ts';
import { say, type Key } from '../words/text.ts';
import type { Chunk } from './mic-worklet.ts';
import workletUrl from './mic-worklet.ts?worker&url';

const PATIENCE = 10_000; // ms from the permission to the first sound
const WATCH = 2000; // ms; two of them without sound, and it has ended

const BROKEN = say('microphone.broken');
const SILENT = say('microphone.silent');
const ENDED = say('microphone.ended');
const DISCONNECTED = say('microphone.disconnected');

/** Takes a chunk and when its last sample was recorded, ms on the performance clock. */
export type OnChunk = (pcm: Int16Array, end: number) => void;

/** One stream from the microphone and what turns it into chunks; it closes all of it or nothing. */
export class Recording {
  readonly track: MediaStreamTrack;
  private readonly stream: MediaStream;
  private readonly onChunk: OnChunk;
  private context: AudioContext | null = null;
  private node: AudioWorkletNode | null = null;
  private watch: ReturnType<typeof setInterval> | undefined;
  private heard = false; // something, since it was last asked
  private fail: (error: PageError) => void = () => {};

  private constructor(stream: MediaStream, onChunk: OnChunk) {
    this.stream = stream;
    this.track = stream.getAudioTracks()[0]!;
    this.onChunk = onChunk;
  }

  /**
   * Asks for the microphone and waits for its first sound.
   *
   * @param onEnd called when the recording has closed by itself
   * @param stopped closes the recording, now or later
   * @throws PageError saying what the visitor can do about it
   */
  static async open(onChunk: OnChunk, onEnd: (error: PageError) => void, stopped: AbortSignal): Promise<Recording> {
    const recording = new Recording(await askForMicrophone(), onChunk);
    try {
      stopped.throwIfAborted();
      await recording.begin(stopped);
      stopped.throwIfAborted();
    } catch (error) {
      recording.close();
      throw error instanceof PageError ? error : new PageError(BROKEN);
    }
    recording.guard(onEnd);
    return recording;
  }

  private async begin(stopped: AbortSignal): Promise<void> {
    const failed = new Promise<never>((_, reject) => {
      this.fail = reject;
      stopped.onabort = () => {
        this.close();
        reject(stopped.reason);
      };
    });
    for (const track of this.stream.getTracks()) track.onended = () => this.fail(new PageError(DISCONNECTED));
    const late = setTimeout(() => this.fail(new PageError(SILENT)), PATIENCE);
    await Promise.race([this.connect(), failed]).finally(() => clearTimeout(late));
  }

  /** Resolves with the first sound. */
  private async connect(): Promise<void> {
    // Its own context: some browsers refuse a source whose rate differs from the context's.
    const context = (this.context = new AudioContext());
    // Browsers stop a context for a telephone call or another tab; some go on only when asked.
    context.onstatechange = () => void context.resume().catch(() => {});
    await context.audioWorklet.addModule(workletUrl);
    const source = new MediaStreamAudioSourceNode(context, { mediaStream: this.stream });
    const node = new AudioWorkletNode(context, 'microphone', { channelCount: 1, channelCountMode: 'explicit' });
    this.node = node;
    node.onprocessorerror = () => this.fail(new PageError(ENDED));
    // It outputs silence; Chromium leaves out blocks of a node that leads nowhere when it is busy.
    source.connect(node).connect(context.destination);
    await Promise.all([context.resume(), new Promise((resolve) => (node.port.onmessage = resolve))]);
    node.port.onmessage = ({ data }: MessageEvent<Chunk>) => this.hear(data, context.currentTime);
  }

  private hear({ pcm, end }: Chunk, now: number): void {
    this.heard = true;
    const age = Math.max(0, now - end); // while this thread was busy
    this.onChunk(pcm, performance.now() - 1000 * age);
  }

  /** From here on the recording ends by itself when the device, the browser or the worklet fails. */
  private guard(onEnd: (error: PageError) => void): void {
    this.fail = (error) => {
      this.close();
      onEnd(error);
    };
    let silent = 0; // turns of the watch
    this.watch = setInterval(() => {
      silent = this.heard ? 0 : silent + 1;
      this.heard = false;
      if (silent === 2) this.fail(new PageError(ENDED));
    }, WATCH);
  }

  private close(): void {
    clearInterval(this.watch);
    this.fail = () => {};
    for (const track of this.stream.getTracks()) track.stop();
    if (this.node) this.node.port.onmessage = this.node.onprocessorerror = null;
    if (this.context) this.context.onstatechange = null;
    this.context?.close().catch(() => {}); // it may be closed already
  }
}

async function askForMicrophone(): Promise<MediaStream> {
  if (!navigator.mediaDevices) {
    throw new PageError(say('microphone.untrusted'));
  }
  try {
    return await navigator.mediaDevices.getUserMedia({
      audio: { channelCount: 1, echoCancellation: true, noiseSuppression: true, autoGainControl: true },
    });
  } catch (error) {
    if (isKeptFromFrame()) throw new PageError(say('microphone.framed')); // whatever the browser found wrong besides
    throw new PageError(say(REASONS[(error as DOMException).name] ?? 'microphone.failed'));
  }
}

/** Whether this page is in a frame of another one that gives it no microphone; not all browsers tell. */
function isKeptFromFrame(): boolean {
  const { featurePolicy } = document as { featurePolicy?: { allowsFeature(name: string): boolean } };
  return window.parent !== window && featurePolicy?.allowsFeature('microphone') === false;
}

const REASONS: Record<string, Key> = {
  NotAllowedError: 'microphone.blocked',
  NotFoundError: 'microphone.missing',
  NotReadableError: 'microphone.held',
};
