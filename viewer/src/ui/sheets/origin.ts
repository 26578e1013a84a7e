import { isSynthetic } from '../../bundle/manifest.ts';
import type { Part, Provenance } from '../../bundle/texts.ts';
import type { PageWords } from '../../words/page-words.ts';
import { say, type Key, type Sentence } from '../../words/text.ts';
import { byId } from '../elements.ts';
import { Disclosure } from './disclosure.ts';

const NOT_STATED = 'not stated';

/** The mark that a machine is seen and heard, and behind it whose likeness the avatar is, who agreed and who made it of what. */
export function showOrigin(root: HTMLElement, words: PageWords, provenance: Provenance, signal: AbortSignal): void {
  new Disclosure(root, 'origin', signal, undefined, 'ai-button');
  const list = byId(root, 'origin').querySelector('dl')!;
  list.replaceChildren(
    ...rowsOf(provenance).flatMap(([name, ...values]) => [written('dt', say(name), words), ...values.map((value) => written('dd', value, words))]),
  );
}

function written(tag: 'dt' | 'dd', sentence: Sentence, words: PageWords): HTMLElement {
  const element = document.createElement(tag);
  words.write(element, sentence);
  return element;
}

type Row = [Key, ...Sentence[]];

/** What is told, row by row; sources each on a line, for what is one line is laid out at once. */
export function rowsOf(provenance: Provenance): Row[] {
  const { consent, sources, licence, made_by, made_on } = provenance;
  const who: Row[] = isSynthetic(provenance)
    ? [['origin.likeness', say('origin.nobody')]]
    : [
        ['origin.likeness', told(provenance.likeness)],
        ['origin.consent', told(consent)],
      ];
  const voice: Row[] = provenance.voice
    ? [
        ['origin.voice', say('origin.cloned', { recording: provenance.voice.recording })],
        ['origin.voice.consent', told(provenance.voice.consent)],
      ]
    : [];
  return [...who, ...(provenance.parts ?? []).map(ofPart), ...voice, ['origin.sources', ...(sources.length ? sources : ['']).map(told)], ['origin.licence', told(licence)], ['origin.maker', told(made_by)], ['origin.day', told(made_on)]];
}

/** Whether the head, or the body, was recorded or made. */
function ofPart(part: Part): Row {
  const made = isSynthetic(part);
  return [part.name === 'head' ? 'origin.head' : 'origin.body', made ? say('origin.made') : say('origin.recorded', { whom: part.likeness })];
}

/** A text of whoever made the bundle, as it is. */
function told(text = ''): Sentence {
  return text.trim() && text !== NOT_STATED ? text : say('origin.unstated');
}
