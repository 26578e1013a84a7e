/** A stretch of an utterance and the frame of the audio clock on which it begins. */
interface Segment {
  first: number; // sample of the utterance
  count: number;
  start: number; // frame
}

/**
 * When each sample of one utterance is due, in whole frames of the audio clock.
 *
 * Without underruns that is one constant offset, so pieces join without a gap or an overlap. A
 * piece that comes too late moves itself and all that follow; the face asks `positionAt`, so it
 * waits with the sound.
 */
export class Schedule {
  shifted = 0; // frames of silence that underruns have put in
  private readonly segments: Segment[] = [];
  private readonly lead: number;
  private offset = 0;
  private broken = true; // the next piece has nothing to follow

  /** @param lead frames between now and the start of a piece that has nothing to follow */
  constructor(lead: number) {
    this.lead = lead;
  }

  /**
   * Places the next piece.
   *
   * @param now frame that the audio clock shows
   * @param earliest frame before which nothing may start (another utterance still speaks)
   * @returns the frame on which the piece starts
   */
  place(first: number, count: number, now: number, earliest = 0): number {
    const fresh = this.segments.length === 0;
    let start = first + this.offset;
    if (this.broken || start < now) {
      const next = Math.max(now + this.lead, fresh ? earliest : 0);
      if (!this.broken) this.shifted += next - start;
      this.offset = next - first;
      this.broken = false;
      start = next;
    }
    this.segments.push({ first, count, start });
    return start;
  }

  /** Takes back what is due from `frame` on; gives the sample that was due there. */
  cut(frame: number): number {
    const next = Math.max(0, this.positionAt(frame));
    while (this.segments.length > 0 && this.segments.at(-1)!.start >= frame) this.segments.pop();
    const last = this.segments.at(-1);
    if (last) last.count = Math.min(last.count, frame - last.start);
    this.broken = true;
    return next;
  }

  /** The frame on which the utterance's first piece starts. */
  get start(): number {
    return this.segments[0]?.start ?? Infinity;
  }

  /** The frame after the last one placed so far. */
  get end(): number {
    const last = this.segments.at(-1);
    return last ? last.start + last.count : 0;
  }

  /** Sample of the utterance that plays on `frame`; negative before it begins, held in gaps. */
  positionAt(frame: number): number {
    let segment = this.segments[0];
    if (!segment) return -Infinity;
    for (let i = this.segments.length - 1; i > 0; i--) {
      if (this.segments[i]!.start <= frame) {
        segment = this.segments[i]!;
        break;
      }
    }
    return segment.first + Math.min(frame - segment.start, segment.count);
  }
}
