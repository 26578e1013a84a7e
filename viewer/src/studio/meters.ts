import type { PageWords } from '../words/page-words.ts';
import { say, type Sentence } from '../words/text.ts';
import { TURNS, type Status } from './recordings.ts';

/** Shows how much of what an avatar learns from has been recorded: time, sounds, turns of the head. */
export function showMeters(list: HTMLElement, words: PageWords, covered: Status['covered']): void {
  const { seconds, enough, sounds, of_sounds: all, turns } = covered;
  list.replaceChildren(
    ...row(words, say('studio.meter.time'), seconds / enough, say('studio.meter.seconds', { n: Math.round(seconds), all: enough })),
    ...row(words, say('studio.meter.sounds'), sounds / all, say('studio.meter.of', { n: sounds, all })),
    ...turnRow(words, turns),
  );
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
