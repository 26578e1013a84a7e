import type { Offer, Services } from '../protocol.ts';
import { makeDisclosure } from './disclosure.ts';
import { byId } from './elements.ts';
import { icon } from './icons.ts';

const JOBS = { recognition: 'Listens', language: 'Thinks', voice: 'Speaks' } as const;

/** Which services there are, which one serves, and what the better ones need. */
export class ServiceSheet {
  private readonly button: HTMLButtonElement;
  private readonly sheet: HTMLElement;
  private readonly choose: (offer: Offer) => void;

  /** @param choose what happens when the visitor wants another one */
  constructor(root: ParentNode, choose: (offer: Offer) => void) {
    this.button = byId(root, 'services-button');
    this.sheet = byId(root, 'services');
    this.choose = choose;
    this.button.append(icon('sliders'));
    makeDisclosure(this.button, this.sheet);
  }

  /** Shows what a server offers; nothing where it offers nothing. */
  show(services: Services, offers: readonly Offer[]): void {
    this.button.hidden = offers.length === 0;
    if (offers.length === 0 && !this.sheet.hidden) this.button.click();
    const groups = Object.entries(JOBS).map(([kind, job]) => {
      const group = document.createElement('fieldset');
      const legend = document.createElement('legend');
      legend.textContent = job;
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
