import type { Offer, Services } from '../../protocol.ts';
import type { PageWords } from '../../words/page-words.ts';
import { serviceName } from '../../words/services.ts';
import { say } from '../../words/text.ts';
import { byId } from '../elements.ts';

const KINDS = ['recognition', 'language', 'voice'] as const;

/** Which services may be chosen and which one serves; folded away, what the others need. */
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
    const serves = (offer: Offer) => services[offer.kind].name === offer.name;
    const [here, missing] = split(offers, (offer) => offer.hindrance === '' || serves(offer));
    const kinds = KINDS.map((kind) => {
      const offered = here.filter((offer) => offer.kind === kind);
      return offered.length === 1 && offered.every(serves) ? this.only(offered[0]!) : this.choice(kind, offered, serves);
    });
    this.sheet.replaceChildren(...kinds, ...(missing.length > 0 ? [this.others(missing)] : []));
  }

  /** A service beside which there is none of its kind to choose. */
  private only(offer: Offer): HTMLElement {
    const row = this.named(document.createElement('div'), document.createElement('span'), offer.kind);
    row.className = 'row';
    row.append(this.told(document.createElement('span'), offer));
    return row;
  }

  private choice(kind: Offer['kind'], offers: readonly Offer[], serves: (offer: Offer) => boolean): HTMLFieldSetElement {
    const group = this.named(document.createElement('fieldset'), document.createElement('legend'), kind);
    group.append(...offers.map((offer) => this.row(offer, serves(offer))));
    return group;
  }

  /** What cannot be chosen, and what it needs. */
  private others(missing: readonly Offer[]): HTMLDetailsElement {
    const others = document.createElement('details');
    const summary = document.createElement('summary');
    this.words.write(summary, say('services.others'));
    const lists = KINDS.flatMap((kind) => {
      const items = missing.filter((offer) => offer.kind === kind).map((offer) => this.told(document.createElement('li'), offer));
      if (items.length === 0) return [];
      const list = document.createElement('ul');
      list.append(...items);
      const group = this.named(document.createElement('div'), document.createElement('p'), kind);
      group.append(list);
      return [group];
    });
    others.append(summary, ...lists);
    return others;
  }

  /** A group under the name of a kind of services. */
  private named<T extends HTMLElement>(group: T, name: HTMLElement, kind: Offer['kind']): T {
    this.words.write(name, say(`services.${kind}`));
    group.append(name);
    return group;
  }

  private row(offer: Offer, chosen: boolean): HTMLLabelElement {
    const row = document.createElement('label');
    const input = document.createElement('input');
    input.type = 'radio';
    input.name = offer.kind;
    input.value = offer.key;
    input.checked = chosen;
    input.onchange = () => this.choose(offer);
    row.append(input);
    return this.told(row, offer);
  }

  /** A row with a service's name, and with what prevents it. */
  private told<T extends HTMLElement>(row: T, { name, hindrance }: Offer): T {
    const title = document.createElement('span');
    this.words.write(title, serviceName(name));
    row.append(title);
    if (hindrance) {
      const hint = document.createElement('small');
      hint.lang = 'en'; // commands and settings, for whoever runs the server
      hint.textContent = hindrance;
      row.append(hint);
    }
    return row;
  }
}

/** Two lists: what fulfils a condition, and the rest. */
function split<T>(all: readonly T[], fulfils: (one: T) => boolean): [T[], T[]] {
  return [all.filter(fulfils), all.filter((one) => !fulfils(one))];
}
