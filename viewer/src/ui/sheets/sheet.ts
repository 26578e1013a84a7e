import type { Offer, Services } from '../../protocol.ts';
import type { PageWords } from '../../words/page-words.ts';
import { say } from '../../words/text.ts';
import { byId } from '../elements.ts';

const KINDS = ['recognition', 'language', 'voice'] as const;

/** Which services there are, which one serves, and what the better ones need. */
export class ServiceSheet {
  private readonly sheet: HTMLElement;
  private readonly words: PageWords;
  private readonly choose: (offer: Offer) => void;

  /** @param choose what happens when the visitor wants another one */
  constructor(root: ParentNode, words: PageWords, choose: (offer: Offer) => void) {
    this.words = words;
    this.sheet = byId(root, 'services');
    this.choose = choose;
  }

  /** Shows what a server offers; nothing where it offers nothing. */
  show(services: Services, offers: readonly Offer[]): void {
    this.sheet.hidden = offers.length === 0;
    const groups = KINDS.map((kind) => {
      const group = document.createElement('fieldset');
      const legend = document.createElement('legend');
      this.words.write(legend, say(`services.${kind}`));
      const rows = offers
        .filter((offer) => offer.kind === kind)
        .map((offer) => this.row(offer, services[offer.kind].name === offer.name));
      group.append(legend, ...rows);
      return group;
    });
    this.sheet.replaceChildren(...groups);
  }

  private row(offer: Offer, chosen: boolean): HTMLLabelElement {
    const row = document.createElement('label');
    const input = document.createElement('input');
    input.type = 'radio';
    input.name = offer.kind;
    input.value = offer.key;
    input.checked = chosen;
    input.disabled = offer.hindrance !== '' && !chosen;
    input.onchange = () => this.choose(offer);
    const name = document.createElement('span');
    name.textContent = offer.name;
    row.append(input, name);
    if (offer.hindrance) {
      const hindrance = document.createElement('small');
      hindrance.textContent = offer.hindrance;
      row.append(hindrance);
    }
    return row;
  }
}
