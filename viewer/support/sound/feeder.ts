import type { Page } from 'playwright-core';

/** Seconds the feeder keeps ahead, as the server does. */
export const AHEAD = 1.5;

/**
 * Feeds the page's player with `seconds` of noise from an utterance on, in pieces of 50–100 ms, half
 * as long as the server's: errors that grow from piece to piece show twice as fast. Its face goes
 * round once a second (cos 2πt, sin 2πt, 0 …). Returns at once.
 */
export function feed(page: Page, utterance: number, seconds: number): Promise<void> {
  return page.evaluate(
    ([id, duration, ahead]) => {
      const { head, conversation } = window.ico3d!;
      const { player } = conversation!;
      const columns = head!.expression.length;
      const began = performance.now();
      window.pieces = [];
      let sample = 0;
      let row = 0;
      const timer = setInterval(() => {
        while (sample < duration * 24000 && sample / 24000 < (performance.now() - began) / 1000 + ahead) {
          const count = Math.min(1200 + ((sample * 7919) % 1201), duration * 24000 - sample);
          // Never 0, so that silence is told from sound: −16384…16383 by a hash of the sample.
          const pcm = Int16Array.from({ length: count }, (_, i) => window.noise!(sample + i));
          const rows = Math.floor(((sample + count) / 24000) * 25) - row + 1;
          const values = new Float32Array(columns * rows);
          for (let i = 0; i < rows; i++) {
            const angle = (2 * Math.PI * (row + i)) / 25;
            values.set([Math.cos(angle), Math.sin(angle)], columns * i);
          }
          const expressions = { rows, columns, values };
          player.play({ utterance: id, first_sample: sample, first_expression: row, pcm, expressions });
          window.pieces!.push({ sample, count });
          sample += count;
          row += rows;
        }
        if (sample >= duration * 24000) {
          clearInterval(timer);
          player.end(id, sample);
        }
      }, 50);
    },
    [utterance, seconds, AHEAD] as const,
  );
}

declare global {
  interface Window {
    noise?: (sample: number) => number;
    pieces?: { sample: number; count: number }[]; // fed so far
  }
}

/** The feeder's sound: a 16-bit value by a hash of the sample's index, never 0. */
export function noise(sample: number): number {
  const hash = Math.imul(sample + 1, 0x9e3779b1) >>> 17; // 15 bits
  return hash - 16384 || 1;
}
