import { chance } from '../noise.ts';

export const FRAME = 0.01; // s between two values of loudness
const WINDOW = 0.025; // s of sound that a value of loudness measures
const FLOOR = -80; // least value of loudness, dB
const SPOKEN = 25; // sound counts as speech down to so many dB below the loudest value
const AUDIBLE = -50; // loudness below which sound is never speech, dB
const PHRASE = 1.2; // s that the visitor must have spoken since the last nod
const PAUSE = 0.25; // s of silence after which a nod may follow
const APART = 3; // least time between two nods, s
const OFTEN = 0.65; // probability of a nod in a pause

/** Loudness of sound that arrives piece by piece; as `GrowingLoudness` in `ico3d/motion/composing/accents.py`. */
export class Loudness {
  private readonly rate: number;
  private readonly half: number; // samples of half a window
  private count = 0; // number of values so far
  private first = 0; // index of the first sample that is kept
  private kept = new Float64Array(0);

  /** @param rate samples per second */
  constructor(rate: number) {
    this.rate = rate;
    this.half = Math.max(1, Math.round(0.5 * WINDOW * rate));
  }

  /** Appends sound; returns the new values in dB, one per `FRAME` seconds, whose windows are complete now. */
  push(pcm: Int16Array): number[] {
    const joined = new Float64Array(this.kept.length + pcm.length);
    joined.set(this.kept);
    joined.set(Float64Array.from(pcm, (sample) => sample / 32768), this.kept.length);
    this.kept = joined;
    const levels: number[] = [];
    for (; this.middle() + this.half <= this.first + this.kept.length; this.count++) {
      const begin = Math.max(this.middle() - this.half, 0) - this.first;
      const window = this.kept.subarray(begin, this.middle() + this.half - this.first);
      const mean = window.reduce((sum, sample) => sum + sample * sample, 0) / window.length;
      levels.push(Math.max(10 * Math.log10(Math.max(mean, 1e-12)), FLOOR));
    }
    const past = Math.max(this.middle() - this.half - this.first, 0);
    this.kept = this.kept.slice(past);
    this.first += past;
    return levels;
  }

  private middle(): number {
    return Math.round(this.count * FRAME * this.rate);
  }
}

/** Decides on nods, at random after the visitor's phrases; as in `ico3d/motion/composing/listening.py`. */
export class Listener {
  private readonly seed: number;
  private frames = 0;
  private spoken = 0;
  private silent = 0;
  private loudest = AUDIBLE;
  private pauses = 0;
  private last = -APART;

  constructor(seed: number) {
    this.seed = seed;
  }

  /** Takes loudness; returns nods to begin: seconds since the listener began, and the gesture's name. */
  hear(levels: readonly number[]): [number, string][] {
    return levels.flatMap((level) => this.step(level));
  }

  private step(level: number): [number, string][] {
    this.frames++;
    this.loudest = Math.max(this.loudest - 0.01, level, AUDIBLE);
    if (level > Math.max(this.loudest - SPOKEN, AUDIBLE)) {
      this.spoken++;
      this.silent = 0;
      return [];
    }
    this.silent++;
    const pauses = this.silent === Math.round(PAUSE / FRAME) && this.spoken * FRAME >= PHRASE;
    return pauses ? this.pause() : [];
  }

  /** A nod, or none, for a pause of the visitor after a phrase. */
  private pause(): [number, string][] {
    const now = this.frames * FRAME;
    this.pauses++;
    if (now - this.last < APART || chance(this.seed, this.pauses) >= OFTEN) return [];
    this.last = now;
    this.spoken = 0;
    return [[now, chance(this.seed, this.pauses, 1) < 0.7 ? 'small_nod' : 'nod']];
  }
}
