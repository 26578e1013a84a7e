import { expect, test } from 'vitest';
import { FADE, Voice, type Sink } from '../../src/audio/voice.ts';
import { SPEECH_RATE } from '../../src/protocol.ts';

const RATE = SPEECH_RATE;
const GUARD = 480; // frames between now and the first that can still be scheduled
const PIECE = 3600; // samples: 150 ms

/** A loudspeaker on paper: what was scheduled, drawn frame by frame on the audio clock. */
class Paper implements Sink {
  clock = 0; // frames
  private readonly sounds: { start: number; pcm: Int16Array; end: number }[] = [];
  private readonly fades: { from: number; to: number; start: number }[] = [];

  now() {
    return this.clock + GUARD;
  }

  play(pcm: Int16Array, start: number) {
    expect(start).toBeGreaterThanOrEqual(this.now());
    const sound = { start, pcm, end: start + pcm.length };
    this.sounds.push(sound);
    return (end: number) => void (sound.end = Math.min(sound.end, end));
  }

  fade(from: number, to: number, start: number) {
    expect(start).toBeGreaterThanOrEqual(this.now());
    this.fades.push({ from, to, start });
  }

  /** The volume on a frame. */
  gain(frame: number): number {
    const fade = this.fades.findLast(({ start }) => start <= frame);
    if (!fade) return 1;
    return fade.from + (fade.to - fade.from) * Math.min((frame - fade.start) / FADE, 1);
  }

  /** The sample that sounds on a frame; null in silence. Two at once would be a mistake. */
  sample(frame: number): number | null {
    const found = this.sounds.filter(({ start, end }) => start <= frame && frame < end);
    if (found.length > 1) throw new Error(`two sounds on frame ${frame}`);
    return found[0] ? found[0].pcm[frame - found[0].start]! : null;
  }
}

/** Piece `index` of an utterance in which sample i has the value i. */
function piece(index: number) {
  const first_sample = index * PIECE;
  const pcm = Int16Array.from({ length: PIECE }, (_, i) => first_sample + i);
  const expressions = { rows: 0, columns: 0, values: new Float32Array() };
  return { utterance: 0, first_sample, first_expression: 0, pcm, expressions };
}

test('a pause silences within 20 ms, and all is heard nevertheless, in order, to the last sample', () => {
  const paper = new Paper();
  const voice = new Voice(0, paper);
  for (const index of [0, 1, 2]) voice.add(piece(index));
  const begin = voice.schedule.start;
  paper.clock = begin + 5000;
  voice.pause();
  const silent = paper.now() + FADE;
  paper.clock = silent + 7000;
  voice.add(piece(3)); // arrives meanwhile
  expect(voice.schedule.positionAt(paper.clock)).toBe(5000 + GUARD); // the face and the server wait too
  voice.resume();
  paper.clock += 5000;
  voice.add(piece(4));

  const frames = (from: number, count: number) => Array.from({ length: count }, (_, i) => from + i);
  expect(frames(silent, 7000).every((frame) => paper.gain(frame) === 0 || paper.sample(frame) === null)).toBe(true);
  const heard = new Map<number, number>(); // sample: the sum of its volumes
  const order: number[] = [];
  for (const frame of frames(begin, 40_000)) {
    const sample = paper.sample(frame);
    if (sample === null) continue;
    order.push(sample);
    heard.set(sample, (heard.get(sample) ?? 0) + paper.gain(frame));
  }
  const backwards = order.filter((sample, i) => i > 0 && sample !== order[i - 1]! + 1);
  expect(backwards).toEqual([5000 + GUARD]); // it goes on with the sample at which it began to fade
  expect(heard.size).toBe(5 * PIECE);
  const wrong = [...heard.values()].filter((volume) => Math.abs(volume - 1) > 1e-9);
  expect(wrong).toEqual([]); // faded out, then in: once in all
  expect(voice.schedule.shifted).toBe(0); // silence that was wanted is no underrun
});

test('the volume falls by 20 dB and more within 40 ms of the message', () => {
  const paper = new Paper();
  const voice = new Voice(0, paper);
  voice.add(piece(0));
  paper.clock = voice.schedule.start + 1000;
  voice.pause();
  const ducked = Math.ceil(paper.clock + 0.04 * RATE);
  for (let frame = ducked; frame < ducked + RATE; frame += 24) expect(paper.gain(frame)).toBeLessThanOrEqual(0.1);
});

test('nothing of it is heard any more once it is stopped, paused or not', () => {
  for (const paused of [false, true]) {
    const paper = new Paper();
    const voice = new Voice(0, paper);
    for (const index of [0, 1, 2]) voice.add(piece(index));
    paper.clock = voice.schedule.start + 3000;
    if (paused) voice.pause();
    voice.silence();
    const silent = paper.now() + FADE;
    const after = Array.from({ length: 20_000 }, (_, i) => paper.sample(silent + i));
    expect(after.every((sample) => sample === null)).toBe(true);
  }
});

test('a pause before its first sample puts all of it off', () => {
  const paper = new Paper();
  const voice = new Voice(0, paper);
  voice.add(piece(0));
  voice.pause();
  paper.clock = 10_000;
  voice.resume();
  expect(voice.schedule.start).toBeGreaterThan(10_000);
  expect(paper.sample(voice.schedule.start)).toBe(0);
  expect(paper.sample(voice.schedule.start + PIECE - 1)).toBe(PIECE - 1);
});

/** The pieces that are played anew when a voice goes on. */
function replayed(pieces: { first_sample: number; pcm: Int16Array }[]) {
  const paper = new Paper();
  const voice = new Voice(0, paper);
  const expressions = { rows: 0, columns: 0, values: new Float32Array() };
  for (const each of pieces) voice.add({ utterance: 0, first_expression: 0, expressions, ...each });
  voice.pause();
  const played: Int16Array[] = [];
  const play = paper.play.bind(paper);
  paper.play = (pcm, start) => {
    played.push(pcm);
    return play(pcm, start);
  };
  voice.resume();
  return { voice, paper, played };
}

test('what goes on after a pause is few long stretches, however short its pieces were', () => {
  const pieces = Array.from({ length: 300 }, (_, index) => piece(index)); // 45 s
  const { voice, paper, played } = replayed(pieces);
  expect(played.map((pcm) => pcm.length / RATE)).toEqual([9.9, 9.9, 9.9, 9.9, 5.4]);
  expect(played.flatMap((pcm) => [pcm[0]!, pcm.at(-1)!]).slice(0, 3)).toEqual([0, Int16Array.of(66 * PIECE - 1)[0], Int16Array.of(66 * PIECE)[0]]);
  voice.pause();
  const before = [...played];
  voice.resume();
  expect(played.slice(5)).toEqual(before); // and the same objects, which are ready to be played
  expect(played.slice(6).every((pcm, index) => pcm === before[index + 1])).toBe(true);
  expect(paper.sample(voice.schedule.start)).toBe(0);
});

test('of pieces with gaps between them 64 go on, and nothing is played beyond twenty minutes', () => {
  const apart = Array.from({ length: 1000 }, (_, index) => ({ first_sample: index * RATE, pcm: new Int16Array(1) }));
  expect(replayed(apart).played).toHaveLength(64);
  const late = [0, 1200 * RATE - 1, 1200 * RATE].map((first_sample) => ({ first_sample, pcm: new Int16Array(1) }));
  expect(replayed(late).played).toHaveLength(2);
});
