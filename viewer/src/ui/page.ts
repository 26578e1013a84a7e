import type { Offer, Services } from '../protocol.ts';
import type { Figures } from '../stage/figures.ts';
import type { Conversation, ConversationView } from '../talk/conversation.ts';
import { Captions } from './captions.ts';
import { Controls } from './controls.ts';
import { byId } from './elements.ts';
import { Overlay } from './overlay.ts';
import { Panel } from './panel.ts';
import { ServiceSheet } from './sheet.ts';

const NOTICE_TIME = 9000; // ms

const STATES = {
  connecting: 'Connecting …',
  idle: 'Ready',
  listening: 'Listening',
  thinking: 'Thinking',
  speaking: 'Speaking',
  queued: 'Waiting for a place',
  ended: 'Ended',
} as const;

/** What is around the picture. */
export interface Page {
  view: ConversationView;
  /** Shows the controls of a conversation and starts it. */
  talk(conversation: Conversation): void;
}

/**
 * Everything on the page around the picture.
 *
 * @param root what the page lies in
 * @param signal ends all of it
 */
export function makePage(root: HTMLElement, overlay: Overlay, figures: () => Figures, signal: AbortSignal): Page {
  const captions = new Captions(root);
  const controls = new Controls(root, signal);
  const panel = new Panel(root, figures, signal);
  let choose: (offer: Offer) => void = () => {};
  let again = () => {};
  const sheet = new ServiceSheet(root, (offer) => choose(offer));
  const view: ConversationView = {
    state(state) {
      root.dataset.state = state;
      byId(root, 'state').textContent = STATES[state];
      controls.setSpeaking(state === 'speaking');
      if (state === 'connecting') overlay.reconnect();
    },
    question: (text, final) => captions.question(text, final),
    answer: (sentence) => captions.answer(sentence),
    services(services, offers) {
      showStandIns(root, services);
      sheet.show(services, offers);
    },
    notice: (sentence) => showNotice(root, sentence),
    sharesVoice: (shared) => (byId(root, 'shared-voice').hidden = !shared),
    microphone: (state) => controls.setMicrophone(state),
    talking: (held) => controls.setTalking(held),
    latency: (milliseconds) => panel.latency(milliseconds),
    metrics: (name, values) => panel.metrics(name, values),
    silenced: (silent) => (byId(root, 'silenced').hidden = !silent),
    queued: (place) => overlay.queue(place),
    connected: () => overlay.isShown && (overlay.hide(), controls.focus()),
    ended: (ending) => overlay.end(ending, () => again()),
  };
  const talk = (conversation: Conversation) => {
    byId(root, 'state-line').hidden = false;
    controls.bind(conversation);
    choose = (offer) => conversation.choose(offer);
    again = () => conversation.start();
    conversation.start();
  };
  return { view, talk };
}

/** Says plainly which services are the small offline ones. */
function showStandIns(root: ParentNode, services: Services): void {
  const names = Object.values(services)
    .filter((service) => service.stand_in)
    .map((service) => service.name);
  const note = byId(root, 'stand-ins');
  note.hidden = names.length === 0;
  note.textContent = `Offline stand-ins: ${names.join(', ')}`;
}

/** Shows a sentence for some seconds; one that is there already stays as it is: many would cover the face. */
export function showNotice(root: ParentNode, sentence: string): void {
  if ([...byId(root, 'notices').children].some(({ textContent }) => textContent === sentence)) return;
  const item = document.createElement('p');
  item.textContent = sentence;
  byId(root, 'notices').append(item);
  setTimeout(() => item.remove(), NOTICE_TIME);
}
