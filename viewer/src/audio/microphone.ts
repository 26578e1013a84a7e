import { PageError } from '../errors.ts';
import type { Chunk } from './mic-worklet.ts';
import workletUrl from './mic-worklet.ts?worker&url';

/** Takes a chunk and when its last sample was recorded, ms on the performance clock. */
type OnChunk = (pcm: Int16Array, end: number) => void;

/** The visitor's microphone as PCM16 at 16 kHz in chunks. */
export class Microphone {
  private context: AudioContext | null = null;
  private stream: MediaStream | null = null;
  private readonly onChunk: OnChunk;
  private readonly onLost: (error: PageError) => void;

  /** @param onLost the device went away */
  constructor(onChunk: OnChunk, onLost: (error: PageError) => void) {
    this.onChunk = onChunk;
    this.onLost = onLost;
  }

  get open(): boolean {
    return this.stream !== null;
  }

  /** What it records; null while it is closed. */
  get track(): MediaStreamTrack | null {
    return this.stream?.getAudioTracks()[0] ?? null;
  }

  /**
   * Asks for the microphone and starts it.
   *
   * @throws PageError saying what the visitor can do about it
   */
  async start(): Promise<void> {
    this.stream = await askForMicrophone();
    this.stream.getAudioTracks()[0]!.onended = () => {
      this.stop();
      this.onLost(new PageError('The microphone was disconnected; you can type instead.'));
    };
    // Its own context: some browsers refuse a source whose rate differs from the context's.
    const context = new AudioContext();
    this.context = context;
    await context.audioWorklet.addModule(workletUrl);
    const source = new MediaStreamAudioSourceNode(context, { mediaStream: this.stream });
    const node = new AudioWorkletNode(context, 'microphone', {
      channelCount: 1,
      channelCountMode: 'explicit',
    });
    node.port.onmessage = ({ data }: MessageEvent<Chunk>) => {
      const age = Math.max(0, context.currentTime - data.end); // while this thread was busy
      this.onChunk(data.pcm, performance.now() - 1000 * age);
    };
    // It outputs silence; Chromium leaves out blocks of a node that leads nowhere when it is busy.
    source.connect(node).connect(context.destination);
    await context.resume();
  }

  stop(): void {
    this.stream?.getTracks().forEach((track) => track.stop());
    this.stream = null;
    void this.context?.close();
    this.context = null;
  }
}

async function askForMicrophone(): Promise<MediaStream> {
  if (!navigator.mediaDevices) {
    throw new PageError('Browsers give the microphone only to HTTPS pages and localhost; you can type instead.');
  }
  try {
    return await navigator.mediaDevices.getUserMedia({
      audio: { channelCount: 1, echoCancellation: true, noiseSuppression: true, autoGainControl: true },
    });
  } catch (error) {
    throw new PageError(REASONS[(error as DOMException).name] ?? 'The microphone could not be opened; you can type instead.');
  }
}

const REASONS: Record<string, string> = {
  NotAllowedError: 'The microphone is blocked for this page: allow it in the address bar, or type instead.',
  NotFoundError: 'No microphone was found; plug one in, or type instead.',
  NotReadableError: 'Another program holds the microphone; close it there, or type instead.',
};
