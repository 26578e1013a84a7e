import type { Page } from 'playwright-core';

/** What left the player, sample by sample, and what was asked of it. */
export interface Tapped {
  first: number; // frame of the audio clock of samples[0]
  samples: number[]; // NaN where the tap does not know
  starts: number[]; // seconds at which the page asked pieces to start
}

/** How what was heard compares with what was asked for. */
export interface Placement {
  pieces: number;
  begin: number; // frame of the first sample
  wrong: number; // samples that are not the ones due on their frame
  unseen: number; // samples on frames that the tap missed
  shifted: number; // frames of silence that late pieces have put in
}

declare global {
  interface Window {
    tapped?: Tapped;
  }
}

const WORKLET = `
class Tap extends AudioWorkletProcessor {
  block = [];
  process([[channel]]) {
    if (currentFrame !== this.first + this.block.length) this.send(); // a busy machine misnumbers a block now and then
    if (this.block.length === 0) this.first = currentFrame;
    this.block.push(...(channel ?? new Float32Array(128)));
    if (this.block.length >= 1280) this.send();
    return true;
  }
  send() {
    if (this.block.length > 0) this.port.postMessage({ first: this.first, block: this.block });
    this.block = [];
  }
}
registerProcessor('tap', Tap);`;

const SETTLE = 700; // ms: with its first worklet, an AudioContext moves to another thread

/** Records the player's output on its own audio clock from now on. */
export async function tap(page: Page): Promise<void> {
  await page.evaluate(async (worklet) => {
    const { context, output } = window.ico3d!.conversation!.player;
    const url = URL.createObjectURL(new Blob([worklet], { type: 'text/javascript' }));
    await context.audioWorklet.addModule(url);
    const tapped: Tapped = { first: -1, samples: [], starts: [] };
    window.tapped = tapped;
    const node = new AudioWorkletNode(context, 'tap');
    node.port.onmessage = ({ data }: MessageEvent<{ first: number; block: number[] }>) => {
      if (tapped.starts.length === 0) {
        tapped.samples = []; // one block of silence before the sound is enough
        tapped.first = data.first;
      }
      const gap = data.first - tapped.first - tapped.samples.length;
      if (gap < 0) return; // two blocks with one number: nobody knows which frames the second holds
      for (let i = 0; i < gap; i++) tapped.samples.push(NaN);
      tapped.samples.push(...data.block);
    };
    output.connect(node).connect(context.destination); // silent; what leads nowhere may miss blocks
    const { start } = AudioBufferSourceNode.prototype;
    AudioBufferSourceNode.prototype.start = function (when = 0) {
      tapped.starts.push(when);
      return start.call(this, when);
    };
  }, WORKLET);
  await page.waitForTimeout(SETTLE);
}

/** Compares the tapped sound of the feeder's first utterance with the asked starts, in the page. */
export function comparePlacement(page: Page): Promise<Placement> {
  return page.evaluate(() => {
    const { first, samples, starts } = window.tapped!;
    const begin = Math.round(starts[0]! * 24000);
    const frames = starts.map((start) => Math.round(start * 24000));
    let [wrong, unseen, shifted] = [0, 0, 0];
    window.pieces!.forEach(({ sample, count }, i) => {
      shifted = frames[i]! - begin - sample;
      for (let j = 0; j < count; j++) {
        const heard = samples[frames[i]! + j - first] ?? NaN;
        // Off by a thousandth of a sample, noise would differ by more than a rounding error.
        if (Number.isNaN(heard)) unseen++;
        else if (Math.abs(heard - window.noise!(sample + j) / 0x8000) >= 1e-6) wrong++;
      }
    });
    return { pieces: starts.length, begin, wrong, unseen, shifted };
  });
}
