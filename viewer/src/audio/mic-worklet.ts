import { MICROPHONE_CHUNK, MICROPHONE_RATE } from '../protocol.ts';
import { Resampler, toPcm16 } from './resampler.ts';

// The scope that audio worklets run in; TypeScript's DOM library does not know it.
declare const sampleRate: number;
declare const currentTime: number;
declare class AudioWorkletProcessor {
  readonly port: MessagePort;
}
declare function registerProcessor(name: string, processor: unknown): void;

/** What is posted: PCM16, and the context time at which its last block came. */
export interface Chunk {
  pcm: Int16Array;
  end: number;
}

/** Resamples the microphone and posts it as PCM16 in chunks. */
class MicrophoneProcessor extends AudioWorkletProcessor {
  private readonly resampler = new Resampler(sampleRate, MICROPHONE_RATE);
  private readonly chunk = new Float32Array(MICROPHONE_CHUNK);
  private filled = 0;

  process(inputs: Float32Array[][]): boolean {
    const block = inputs[0]?.[0];
    if (!block) return true; // nothing is connected yet
    for (const value of this.resampler.push(block)) {
      this.chunk[this.filled++] = value;
      if (this.filled === MICROPHONE_CHUNK) this.flush();
    }
    return true;
  }

  private flush(): void {
    const pcm = toPcm16(this.chunk);
    const chunk: Chunk = { pcm, end: currentTime };
    this.port.postMessage(chunk, [pcm.buffer as ArrayBuffer]);
    this.filled = 0;
  }
}

registerProcessor('microphone', MicrophoneProcessor);
