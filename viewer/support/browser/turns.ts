import type { Record } from './recorder.ts';
import { VOICE } from './talk.ts';

const AUDIBLE = 1e-3; // level of the avatar

/** A spoken question that was answered. */
export interface Turn {
  asked: number; // ms of the page's clock at which the question ended
  parts: { [part: string]: number }; // ms
}

/** The spoken questions of a conversation, without the greeting. */
export function turnsOf(record: Record): Turn[] {
  const starts = record.received.filter((m) => m.type === 'speech' && m.first_sample === 0);
  return starts.slice(1).flatMap((speech) => {
    const asked = record.microphone.findLast(({ at, level }) => at < speech.at && level > VOICE);
    const sound = record.loudness.find(({ at, level }) => at > speech.at && level > AUDIBLE);
    const server = record.received.find((m) => m.type === 'metrics' && m.name === 'turn' && m.at >= speech.at);
    if (!asked || !sound) return [];
    const parts = {
      ...(server?.values as Turn['parts']),
      'question’s end to speech message': speech.at - asked.at,
      'speech message to sound': sound.at - speech.at,
      'voice to voice': sound.at - asked.at,
    };
    return [{ asked: asked.at, parts }];
  });
}
