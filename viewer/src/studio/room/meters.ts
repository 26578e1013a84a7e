import type { PageWords } from '../../words/page-words.ts';
import { say, type Sentence } from '../../words/text.ts';
import { TURNS, type Status } from '../recordings.ts';

const TEXT = 8; // s after which the meter shows a text that is being read as read

/** The part that is being recorded just now, and for how many seconds. */
export interface Recorded {
  part: string;
  seconds: number;
}

/** Shows how much of what an avatar learns from has been recorded: time, texts, turns of the head. */
export function showMeters(list: HTMLElement, words: PageWords, status: Status, now: Recorded | null): void {
  const { seconds, enough, turns } = status.covered;
  const texts = status.parts.filter(({ id }) => id.startsWith('text-'));
  const read = texts.filter(({ state }) => state === 'kept').length;
  const isNew = texts.some(({ id, state }) => id === now?.part && state !== 'kept');
  const reading = now && isNew ? Math.min(1, now.seconds / TEXT) : 0;
  const time = seconds + (now && now.part !== 'consent' ? now.seconds : 0);
  list.replaceChildren(
    ...row(words, say('studio.meter.time'), time / enough, say('studio.meter.seconds', { n: Math.min(Math.round(time), enough), all: enough })),
    ...row(words, say('studio.meter.texts'), (read + reading) / texts.length, say('studio.meter.of', { n: read, all: texts.length })),
    ...turnRow(words, turns),
  );
}

/** What to do about sounds that are not recorded yet; nothing once all are. */
export function soundsOf({ sounds, of_sounds: all }: Status['covered']): Sentence {
  return sounds < all ? say('studio.meter.about', { n: sounds, all }) : '';
}

function row(words: PageWords, title: Sentence, share: number, told: Sentence): HTMLElement[] {
  const [term, description, meter, text] = (['dt', 'dd', 'meter', 'span'] as const).map((tag) => document.createElement(tag));
  words.write(term!, title);
  words.write(meter!, title, 'label');
  (meter as HTMLMeterElement).value = Math.min(1, share);
  words.write(text!, told);
  description!.append(meter!, text!);
  return [term!, description!];
}

/** A small meter for each way to turn the head. */
function turnRow(words: PageWords, turns: Status['covered']['turns']): HTMLElement[] {
  const [term, description] = (['dt', 'dd'] as const).map((tag) => document.createElement(tag));
  words.write(term!, say('studio.meter.turns'));
  description!.className = 'turns';
  for (const turn of TURNS) {
    const label = document.createElement('label');
    const meter = document.createElement('meter');
    const name = document.createElement('span');
    words.write(name, say(`studio.part.${turn}`));
    meter.value = turns[turn];
    meter.dataset.turn = turn;
    label.append(name, meter);
    description!.append(label);
  }
  return [term!, description!];
}
