import type { Offer, Services } from '../protocol.ts';
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

/** Everything on the page around the picture. */
export function makePage(overlay: Overlay, frames: () => number): Page {
  const captions = new Captions();
  const controls = new Controls();
  const panel = new Panel(frames);
  let choose: (offer: Offer) => void = () => {};
  let again = () => {};
  const sheet = new ServiceSheet((offer) => choose(offer));
  const view: ConversationView = {
    state(state) {
      document.body.dataset.state = state;
      byId('state').textContent = STATES[state];
      controls.setSpeaking(state === 'speaking');
    },
    question: (text, final) => captions.question(text, final),
    answer: (sentence) => captions.answer(sentence),
    services(services, offers) {
      showStandIns(services);
      sheet.show(services, offers);
    },
    notice: showNotice,
    sharesVoice: (shared) => (byId('shared-voice').hidden = !shared),
    microphone: (state) => controls.setMicrophone(state),
    talking: (held) => controls.setTalking(held),
    latency: (milliseconds) => panel.latency(milliseconds),
    metrics: (name, values) => panel.metrics(name, values),
    queued: (place) => overlay.queue(place),
    connected: () => overlay.isShown && (overlay.hide(), controls.focus()),
    ended: (ending) => overlay.end(ending, () => again()),
  };
  const talk = (conversation: Conversation) => {
    byId('state-line').hidden = false;
    controls.bind(conversation);
    choose = (offer) => conversation.choose(offer);
    again = () => conversation.start();
    conversation.start();
  };
  return { view, talk };
}

/** Says plainly which services are the small offline ones. */
function showStandIns(services: Services): void {
  const names = Object.entries(services)
    .filter(([, service]) => service.stand_in)
    .map(([role, service]) => `${role} (${service.name})`);
  const note = byId('stand-ins');
  note.hidden = names.length === 0;
  note.textContent = `Offline stand-ins in use: ${names.join(', ')}`;
}

/** Shows a sentence for some seconds. */
export function showNotice(sentence: string): void {
  const item = document.createElement('p');
  item.textContent = sentence;
  byId('notices').append(item);
  setTimeout(() => item.remove(), NOTICE_TIME);
}
