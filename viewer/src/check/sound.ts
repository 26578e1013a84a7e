import { Microphone } from '../audio/microphone.ts';
import { sentenceOf } from '../errors.ts';
import { MICROPHONE_RATE } from '../protocol.ts';
import { say } from '../words/text.ts';
import { bad, fair, good, type Finding } from './finding.ts';

const PITCH = 440; // Hz
const TONE = 1.2; // s
const LOUDNESS = 0.2;
const PATIENCE = 2000; // ms until a loudspeaker has started
const LISTENED = 5; // s
const VOICE = 0.01; // root mean square of a voice, full scale = 1

/** Plays a tone; a finding only where that fails. */
export async function playTone(): Promise<Finding | null> {
  const context = new AudioContext();
  try {
    void context.resume();
    const source = new OscillatorNode(context, { frequency: PITCH });
    const gain = new GainNode(context, { gain: 0 });
    source.connect(gain).connect(context.destination);
    const start = context.currentTime + 0.05;
    gain.gain.setTargetAtTime(LOUDNESS, start, 0.02);
    gain.gain.setTargetAtTime(0, start + TONE - 0.1, 0.02);
    source.start(start);
    source.stop(start + TONE);
    const played = new Promise<boolean>((resolve) => (source.onended = () => resolve(true)));
    const late = new Promise<boolean>((resolve) => setTimeout(() => resolve(false), 1000 * TONE + PATIENCE));
    if (await Promise.race([played, late])) return null;
    return bad(say('check.sound.none'), say('check.sound.free'));
  } finally {
    void context.close();
  }
}

/** @param heard what the visitor says about the tone */
export function judgeTone(heard: boolean): Finding {
  if (heard) return good(say('check.sound.good'));
  return bad(say('check.sound.bad'), say('check.sound.advice'));
}

/**
 * Listens for some seconds.
 *
 * @param onLevel takes the level of each piece of sound, root mean square, full scale = 1
 */
export async function checkMicrophone(onLevel: (level: number) => void, seconds = LISTENED): Promise<Finding> {
  let [loudest, heard] = [0, 0];
  let done = (_: Finding | null) => {};
  const ended = new Promise<Finding | null>((resolve) => (done = resolve));
  const hear = (pcm: Int16Array) => {
    const level = levelOf(pcm);
    onLevel(level);
    loudest = Math.max(loudest, level);
    heard += pcm.length;
    if (heard >= seconds * MICROPHONE_RATE) done(null);
  };
  const microphone = new Microphone(hear, (error) => done(bad(sentenceOf(error), REFUSED)));
  try {
    await microphone.start();
    return (await ended) ?? judgeLevel(loudest);
  } catch (error) {
    return bad(sentenceOf(error), REFUSED);
  } finally {
    microphone.stop();
    onLevel(0);
  }
}

const REFUSED = say('check.microphone.refused');

/** @param loudest level of the loudest piece */
export function judgeLevel(loudest: number): Finding {
  if (loudest >= VOICE) return good(say('check.microphone.good'));
  if (loudest === 0) return bad(say('check.microphone.muted'), say('check.microphone.unmute'));
  return fair(say('check.microphone.quiet'), say('check.microphone.louder'));
}

function levelOf(pcm: Int16Array): number {
  return Math.sqrt(pcm.reduce((sum, value) => sum + (value / 0x8000) ** 2, 0) / pcm.length);
}
