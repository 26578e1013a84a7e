import { rememberedInTab, rememberInTab } from '../remembered.ts';
import type { Conversation } from '../talk/conversation.ts';
import type { ShownMicrophone } from '../talk/voice-input.ts';
import { foreignTo } from '../words/foreign.ts';
import type { PageWords } from '../words/page-words.ts';
import { say, type Sentence, type Tongue } from '../words/text.ts';
import { byId, focusOn } from './elements.ts';
import { icon } from './icons.ts';
import { isFor, isForOthers, isForTexts } from './keyboard/keys.ts';
import { markTyping } from './keyboard/typing.ts';

const CLICK = 350; // ms; who clicks the button to talk does not know that it is held

/** Text box, microphone, button to talk, send and stop: what the visitor does. */
export class Controls {
  private readonly root: HTMLElement;
  private readonly words: PageWords;
  private readonly signal: AbortSignal;
  private readonly form: HTMLFormElement;
  private readonly input: HTMLInputElement;
  private readonly microphone: HTMLButtonElement;
  private readonly talk: HTMLButtonElement;
  private readonly stop: HTMLButtonElement;
  private readonly mute: HTMLButtonElement;
  private readonly send: HTMLButtonElement;
  private opened: ShownMicrophone = 'closed';
  private connected = true;

  /**
   * @param root what keys are heard in
   * @param languages of the talk, BCP 47; none for any
   * @param signal ends the hearing
   */
  constructor(root: HTMLElement, words: PageWords, languages: readonly string[], signal: AbortSignal) {
    this.root = root;
    this.words = words;
    this.signal = signal;
    this.form = byId(root, 'composer');
    this.input = byId(root, 'text');
    this.microphone = byId(root, 'microphone');
    this.talk = byId(root, 'talk');
    this.stop = byId(root, 'stop');
    this.mute = byId(root, 'mute');
    this.talk.append(icon('radio'));
    this.stop.prepend(icon('stop'));
    this.send = byId(root, 'send');
    this.send.append(icon('send'));
    this.showMicrophone();
    markTyping(this.form, this.input, signal);
    const ask = () => words.write(this.input, askIn(foreignTo(words.language, languages)), 'placeholder');
    words.onChange(ask, signal);
    ask();
  }

  /** Shows itself and lets the visitor act on a conversation. */
  bind(conversation: Conversation, notice: (sentence: Sentence) => void): void {
    this.form.hidden = false;
    focusOn(this.input);
    this.form.onsubmit = (event) => {
      event.preventDefault();
      const text = this.input.value.trim();
      if (!text) return;
      if (conversation.ask(text)) this.input.value = '';
      else notice(say('ask.kept'));
    };
    this.microphone.onclick = () => void conversation.toggleMicrophone();
    this.stop.onclick = () => conversation.interrupt();
    this.bindTalk(conversation, notice);
    this.bindMute(conversation, notice);
    this.hear('keydown', (event) => {
      if (isFor('escape', event)) conversation.interrupt();
      if (isFor('write', event) && !isForTexts(event)) {
        event.preventDefault();
        this.input.focus();
      }
    });
  }

  /** The button turns the avatar's sound off and on, and so does M; the tab remembers it. */
  private bindMute(conversation: Conversation, notice: (sentence: Sentence) => void): void {
    const show = (muted: boolean) => {
      conversation.muted = muted;
      this.mute.setAttribute('aria-pressed', String(muted));
      this.mute.replaceChildren(icon(muted ? 'muted' : 'sound'));
      this.words.write(this.mute, say(muted ? 'mute.on' : 'mute.off'), 'title');
    };
    const toggle = () => {
      show(!conversation.muted);
      rememberInTab('muted', String(conversation.muted));
    };
    this.mute.onclick = toggle;
    this.hear('keydown', (event) => {
      if (isFor('mute', event) && !event.repeat && !isForOthers(event)) toggle();
    });
    show(rememberedInTab('muted') === 'true');
    if (conversation.muted) notice(say('mute.kept')); // else somebody waits for a greeting that is not heard
  }

  /** The button is held with a pointer, or with the space bar wherever that types nothing. */
  private bindTalk(conversation: Conversation, notice: (sentence: Sentence) => void): void {
    let since = 0;
    const press = () => void conversation.press();
    const release = () => conversation.release();
    this.talk.onpointerdown = (event) => {
      this.talk.setPointerCapture(event.pointerId);
      since = event.timeStamp;
      press();
    };
    this.talk.onlostpointercapture = (event) => {
      release();
      if (event.timeStamp - since < CLICK) notice(say('talk')); // nobody says anything in so short a time
    };
    this.talk.oncontextmenu = (event) => event.preventDefault(); // a long touch
    this.hear('keydown', (event) => {
      if (!isFor('talk', event) || !this.takesSpace(event.target)) return;
      event.preventDefault();
      if (!event.repeat) press();
    });
    this.hear('keyup', (event) => isFor('talk', event) && release());
    addEventListener('blur', release, { signal: this.signal });
  }

  private hear(type: 'keydown' | 'keyup', act: (event: KeyboardEvent) => void): void {
    this.root.addEventListener(type, act, { signal: this.signal });
  }

  private takesSpace(target: EventTarget | null): boolean {
    if (target === this.input) return this.input.value === '';
    return target === this.talk || !(target as Element).closest('button, input, select, textarea, a');
  }

  /** Lets the visitor type at once. */
  focus(): void {
    focusOn(this.input);
  }

  /** Where a visitor goes on who stopped an answer; with fingers, the text box would open a keyboard over the avatar. */
  private next(): HTMLElement {
    return matchMedia('(pointer: coarse)').matches ? this.microphone : this.input;
  }

  setTalking(held: boolean): void {
    this.talk.setAttribute('aria-pressed', String(held));
  }

  setMicrophone(state: ShownMicrophone): void {
    this.opened = state;
    this.showMicrophone();
  }

  /** Whether anything gets to the server; while nothing does, the microphone waits, and what is typed stays. */
  setConnected(connected: boolean): void {
    this.connected = connected;
    this.send.setAttribute('aria-disabled', String(!connected));
    this.showMicrophone();
  }

  private showMicrophone(): void {
    const { opened } = this;
    const state = this.connected || opened === 'closed' || opened === 'blocked' ? opened : 'waiting';
    const blocked = state === 'blocked';
    this.microphone.replaceChildren(icon(blocked ? 'blocked' : 'microphone'));
    this.words.write(this.microphone, say(blocked ? 'microphone.denied' : 'microphone'), 'label');
    this.microphone.setAttribute('aria-pressed', String(state === 'open'));
    this.microphone.setAttribute('aria-busy', String(state === 'opening' || state === 'waiting'));
    this.words.write(this.microphone, say(`microphone.${state}`), 'title');
  }

  setSpeaking(speaking: boolean): void {
    if (!speaking && this.stop.matches(':focus')) this.next().focus({ preventScroll: true }); // before it can have none
    this.stop.classList.toggle('gone', !speaking);
    this.stop.inert = !speaking;
  }
}

/** What the text box asks for; who talks in foreign languages is asked in the first of them. */
function askIn([first]: readonly Tongue[]): Sentence {
  return first ? say('ask.in', { language: first }) : say('ask');
}
