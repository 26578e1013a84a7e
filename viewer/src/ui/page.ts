import type { Offer } from '../protocol.ts';
import type { Figures } from '../stage/figures.ts';
import type { Conversation, ConversationView } from '../talk/conversation.ts';
import type { PageWords } from '../words/page-words.ts';
import { say, type Sentence } from '../words/text.ts';
import { Captions } from './captions/captions.ts';
import { Controls } from './controls.ts';
import { byId } from './elements.ts';
import { LineNotice } from './line.ts';
import { Overlay } from './overlay.ts';
import { markPressed } from './keyboard/pressed.ts';
import { Help } from './sheets/help.ts';
import { Memory } from './sheets/memory.ts';
import { Panel } from './sheets/panel.ts';
import { Settings } from './sheets/settings.ts';
import { ServiceSheet } from './sheets/sheet.ts';
import { Transcript, type Talker } from './sheets/transcript.ts';
import { StandIns } from './stand-ins.ts';
import { suggest } from './suggestions.ts';

const NOTICE_TIME = 9000; // ms
const MOST_NOTICES = 5;

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
export function makePage(
  root: HTMLElement,
  words: PageWords,
  talker: Talker,
  overlay: Overlay,
  figures: () => Figures,
  signal: AbortSignal,
): Page {
  markPressed(byId(root, 'stage'), signal);
  const captions = new Captions(root, talker.languages[0] ?? '', signal);
  const controls = new Controls(root, words, talker.languages, signal);
  suggest(root, talker.suggestions);
  const line = new LineNotice(root, words, signal);
  const panel = new Panel(root, words, figures, signal);
  const settings = new Settings(root, words, signal);
  new Help(root, words, signal);
  const standIns = new StandIns(root, words);
  const memory = new Memory(root, words, talker.home);
  const transcript = new Transcript(root, words, talker, () => captions.clear(), signal);
  let choose: (offer: Offer) => void = () => {};
  let again = () => {};
  const sheet = new ServiceSheet(root, words, (offer) => choose(offer));
  let hears = false; // whether the microphone is open
  let isNew = true; // the session
  let now: Parameters<ConversationView['state']>[0] | null = null;
  const tellState = () => {
    if (now) words.write(byId(root, 'state'), say(now === 'idle' && hears ? 'state.open' : `state.${now}`));
  };
  const announce = () => ['idle', 'ended'].includes(root.dataset.state!) && transcript.announce(settings.announces);
  const view: ConversationView = {
    state(state) {
      root.dataset.state = now = state;
      tellState();
      controls.setSpeaking(state === 'speaking');
      captions.rest(state === 'idle');
      if (state === 'connecting') overlay.reconnect();
      announce();
    },
    question(text, final) {
      captions.question(text, final);
      if (!final) return;
      transcript.record.asked(text);
      memory.said(text);
      standIns.ask();
    },
    answer: () => {}, // it is shown as it is heard
    heard(progress) {
      captions.heard(progress);
      transcript.heard(progress);
    },
    over(utterance, interrupted) {
      transcript.record.over(utterance, interrupted);
      captions.over(utterance, transcript.record.answered);
      if (!interrupted) standIns.over();
      announce();
    },
    services(services, offers) {
      standIns.show(services, offers.length > 0);
      sheet.show(services, offers);
    },
    memory(offered, tell) {
      const recalls = memory.offer(offered, tell);
      if (isNew) transcript.showRecall(recalls);
    },
    notice: (sentence) => showNotice(root, words, sentence),
    sharesVoice: (shared) => (byId(root, 'shared-voice').hidden = !shared),
    microphone(state) {
      hears = state === 'open';
      tellState();
      controls.setMicrophone(state);
    },
    talking: (held) => controls.setTalking(held),
    latency: (milliseconds) => panel.latency(milliseconds),
    metrics: (name, values) => panel.metrics(name, values),
    silenced: (silent) => (byId(root, 'silenced').hidden = !silent),
    queued: (place) => overlay.queue(place),
    line(state) {
      line.show(state);
      controls.setConnected(state !== 'lost');
    },
    connected(resumed) {
      isNew = !resumed;
      if (isNew) captions.clear();
      transcript.record.begin(resumed);
      if (!overlay.isShown) return;
      overlay.hide();
      controls.focus();
    },
    ended(ending) {
      if (ending.again && ending.wait === null) transcript.close(); // it goes on with a click alone, of anybody
      overlay.end(ending, () => again());
    },
  };
  const talk = (conversation: Conversation) => {
    byId(root, 'state-line').hidden = false;
    controls.bind(conversation, view.notice);
    settings.offerTalk(() => conversation.hangUp());
    transcript.offer();
    choose = (offer) => conversation.choose(offer);
    again = () => conversation.start();
    conversation.start();
  };
  return { view, talk };
}

/** Shows a sentence for some seconds; of many, which would cover the face, the newest. One that is there already stays as it is. */
export function showNotice(root: ParentNode, words: PageWords, sentence: Sentence): void {
  const text = words.text(sentence);
  const notices = byId(root, 'notices');
  if ([...notices.children].some(({ textContent }) => textContent === text)) return;
  const item = document.createElement('p');
  words.write(item, sentence);
  notices.append(item);
  if (notices.children.length > MOST_NOTICES) notices.firstElementChild!.remove();
  setTimeout(() => item.remove(), NOTICE_TIME);
}
