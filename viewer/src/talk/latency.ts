const VOICE_OVER_NOISE = 3; // a chunk this much louder than the quietest ones is voice
const LEAST_VOICE = 0.01; // full scale = 1
const FLOOR_RISE = 1.01; // per chunk: the noise floor follows a louder room within seconds

/** Finds when the visitor last spoke, by loudness: the start of the voice-to-voice time. */
export class VoiceMeter {
  lastVoice: number | null = null; // ms, performance clock
  private floor = LEAST_VOICE;

  /** @param end when the chunk's last sample was recorded, ms on the performance clock */
  hear(pcm: Int16Array, end: number): void {
    let power = 0;
    for (const value of pcm) power += (value / 0x8000) ** 2;
    const level = Math.sqrt(power / pcm.length);
    if (level > Math.max(LEAST_VOICE, VOICE_OVER_NOISE * this.floor)) this.lastVoice = end;
    this.floor = Math.min(this.floor * FLOOR_RISE, Math.max(level, 1e-4));
  }
}

/** Measures from the end of a question to the first sound of its answer, as heard in the page. */
export class TurnTimer {
  private askedAt: number | null = null;

  /** The visitor has finished asking. */
  asked(at: number): void {
    this.askedAt = at;
  }

  /** The answer's first sound is heard; ms since the question's end, null if none was asked. */
  answered(at: number): number | null {
    const asked = this.askedAt;
    this.askedAt = null;
    return asked === null ? null : at - asked;
  }
}

const KEPT = 50; // turns that the figures look back on

/** Median and 95th percentile, ms. */
export interface Spread {
  p50: number;
  p95: number;
}

/** Times of the last turns, by part. */
export class Latencies {
  private readonly values = new Map<string, number[]>();

  add(part: string, milliseconds: number): void {
    const values = this.values.get(part) ?? [];
    values.push(milliseconds);
    this.values.set(part, values.slice(-KEPT));
  }

  spread(part: string): Spread | null {
    const values = this.values.get(part);
    if (!values) return null;
    const sorted = values.toSorted((a, b) => a - b);
    return { p50: quantile(sorted, 0.5), p95: quantile(sorted, 0.95) };
  }
}

/** @param sorted ascending; straight between neighbours */
function quantile(sorted: readonly number[], share: number): number {
  const at = share * (sorted.length - 1);
  const [low, high] = [sorted[Math.floor(at)]!, sorted[Math.ceil(at)]!];
  return low + (high - low) * (at - Math.floor(at));
}
