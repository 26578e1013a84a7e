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
    ...rowsOf(provenance).flatMap(([name, value]) => {
      const [term, told] = [document.createElement('dt'), document.createElement('dd')];
      words.write(term, say(name));
      words.write(told, value);
      return [term, told];
    }),
  );
}

/** What is told, row by row. */
export function rowsOf(provenance: Provenance): [Key, Sentence][] {
  const { consent, sources, licence, made_by, made_on } = provenance;
  const who: [Key, Sentence][] = isSynthetic(provenance)
    ? [['origin.likeness', say('origin.nobody')]]
    : [
        ['origin.likeness', told(provenance.likeness)],
        ['origin.consent', told(consent)],
      ];
  const voice: [Key, Sentence][] = provenance.voice
    ? [
        ['origin.voice', say('origin.cloned', { recording: provenance.voice.recording })],
        ['origin.voice.consent', told(provenance.voice.consent)],
      ]
    : [];
  return [...who, ...(provenance.parts ?? []).map(ofPart), ...voice, ['origin.sources', told(sources.join('; '))], ['origin.licence', told(licence)], ['origin.maker', told(made_by)], ['origin.day', told(made_on)]];
}

/** Whether the head, or the body, was recorded or made. */
function ofPart(part: Part): [Key, Sentence] {
  const made = isSynthetic(part);
  return [part.name === 'head' ? 'origin.head' : 'origin.body', made ? say('origin.made') : say('origin.recorded', { whom: part.likeness })];
}

/** A text of whoever made the bundle, as it is. */
function told(text = ''): Sentence {
  return text.trim() && text !== NOT_STATED ? text : say('origin.unstated');
}
