const LARGEST_LAG = 2; // s; Bluetooth is well under one
const LARGEST_LEAD = 0.05;

/** The part of an AudioContext that tells the time. */
export interface AudioClock {
  readonly currentTime: number;
  readonly baseLatency: number;
  readonly outputLatency?: number;
  getOutputTimestamp?(): AudioTimestamp;
}

/**
 * The context time of the sound that leaves the loudspeaker now.
 *
 * `currentTime` runs ahead of it by the output's latency (a Bluetooth headset's is 0.2 s and
 * more). Browsers whose time stamp makes no sense are asked for their latency instead.
 *
 * @param now performance.now() in ms
 */
export function heardTime(context: AudioClock, now: number): number {
  const { contextTime = 0, performanceTime = 0 } = context.getOutputTimestamp?.() ?? {};
  const heard = contextTime + (now - performanceTime) / 1000;
  const ahead = heard - context.currentTime;
  if (contextTime > 0 && performanceTime > 0 && ahead > -LARGEST_LAG && ahead < LARGEST_LEAD) {
    return Math.min(heard, context.currentTime);
  }
  return context.currentTime - (context.outputLatency || context.baseLatency || 0);
}
