/** Where the body is wanted at a time of the sound. */
export interface Wanted {
  time: number; // s, of the body
  pace: number; // body seconds per second
}

/** Points of an utterance, as many as a server plans at most. */
const MOST = 10_000;

/** What the server planned for one utterance: body time over the time of its sound, in straight lines. */
export class SpeechPath {
  private points: [number, number][] = []; // (s of sound, s of body), sound strictly growing

  /** Adds points; they replace what was planned from the first one's time on. */
  add(points: readonly [number, number][]): void {
    for (const [sound, body] of points) {
      while (this.points.length > 0 && this.points.at(-1)![0] >= sound) this.points.pop();
      if (this.points.length < MOST) this.points.push([sound, body]);
    }
  }

  /** Where the body is wanted; beyond either end it is held. */
  at(seconds: number): Wanted {
    const next = this.points.findIndex(([sound]) => sound > seconds);
    if (next === -1) return { time: this.points.at(-1)![1], pace: 0 };
    const [end, to] = this.points[next]!;
    if (next === 0) return { time: to, pace: 0 };
    const [begin, from] = this.points[next - 1]!;
    const pace = (to - from) / (end - begin);
    return { time: from + pace * (seconds - begin), pace };
  }

  /** Body times of the points that are yet to come. */
  after(seconds: number): number[] {
    return this.points.filter(([sound]) => sound > seconds).map(([, body]) => body);
  }
}
