import { Microphone } from '../audio/microphone.ts';
import { sentenceOf } from '../errors.ts';
import { MICROPHONE_RATE } from '../protocol.ts';
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
    return bad('The browser plays no sound.', 'Is a loudspeaker or headphone connected? Close other programs that use it, and try again.');
  } finally {
    void context.close();
  }
}

/** @param heard what the visitor says about the tone */
export function judgeTone(heard: boolean): Finding {
  if (heard) return good('You heard the tone.');
  return bad(
    'You did not hear the tone.',
    'Turn the volume up and the mute switch off, look which output the system has chosen, and whether the tab or the site is muted.',
  );
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
  const microphone = new Microphone(hear, (error) => done(bad(error.message, REFUSED)));
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

const REFUSED = 'Allow it for this page (the sign beside the address) and in the settings of the system, and try again.';

/** @param loudest level of the loudest piece */
export function judgeLevel(loudest: number): Finding {
  if (loudest >= VOICE) return good('The microphone hears you.');
  if (loudest === 0) return bad('The microphone is open but gives nothing but silence.', 'It is muted, by a switch on it or by the system.');
  return fair('The microphone is open, but nothing as loud as a voice was heard.', 'Speak while it listens, and look whether the system has chosen the right one.');
}

function levelOf(pcm: Int16Array): number {
  return Math.sqrt(pcm.reduce((sum, value) => sum + (value / 0x8000) ** 2, 0) / pcm.length);
}
