import { SoundGuard } from '../audio/interruption.ts';
import { Loudness } from '../audio/loudness.ts';
import { Player } from '../audio/player.ts';
import type { Cue, Offer, PlaceMessage, Release, Services, StateMessage, WelcomeMessage } from '../protocol.ts';
import { codeOf, english, say } from '../words/text.ts';
import { Captioning, type CaptionEvents } from './captioning.ts';
import { Connection, type Ending, type SessionMessage } from './connection.ts';
import { Speaking, type Emit } from './events.ts';
import { TurnTimer } from './latency.ts';
import { told } from './told.ts';
import { VoiceInput, type VoiceView } from './voice-input.ts';
import { WakeLock } from './wake-lock.ts';
import { handle, type Handlers } from './wire.ts';

/** Who moves the body while it speaks. */
export interface Gestures {
  /** Takes what the server planned for an utterance: (s of sound, s of body). */
  plan(utterance: number, points: readonly [number, number][]): void;
  /** Utterances are counted from the start again. */
  reset(): void;
}

/** Who moves a body on a skeleton. */
export interface Acting {
  /** Takes what the server directs for an utterance. */
  plan(utterance: number, directions: readonly (Cue | Release)[]): void;
  /** An utterance was interrupted. */
  stop(utterance: number): void;
  /** Utterances are counted from the start again. */
  reset(): void;
  /** Sound of the visitor. */
  listen(pcm: Int16Array): void;
  /** Whether the avatar listens, thinks, speaks. */
  attend(state: StateMessage['state']): void;
}

const CLOCK_PERIOD = 200; // ms between reports of what has been heard

const REPLACED = say('replaced');
const OFF = say('microphone.off');

/** How what is said gets to the server: it does, it is too slow for all of it, or not at all. */
export type Line = 'up' | 'slow' | 'lost';

/** What the page shows of a conversation. */
export interface ConversationView extends VoiceView, CaptionEvents {
  state(state: StateMessage['state'] | 'connecting' | 'queued' | 'ended'): void;
  question(text: string, final: boolean): void;
  answer(sentence: string): void;
  services(services: Services, offers: readonly Offer[]): void;
  /** Whether the avatar remembers visitors; `tell` tells it what was said in earlier visits. */
  memory(offered: boolean, tell: (texts: readonly string[]) => void): void;
  latency(milliseconds: number): void;
  metrics(name: string, values: Record<string, number>): void;
  /** The visitor waits in the server's queue. */
  queued(place: PlaceMessage): void;
  line(line: Line): void;
  /** The system has stopped the sound until the visitor taps or types, or it goes on. */
  silenced(silent: boolean): void;
  /** A session has begun, or one goes on. */
  connected(resumed: boolean): void;
  ended(ending: Ending): void;
}

/** Microphone, wire and loudspeaker joined into a conversation. */
export class Conversation {
  readonly player = new Player();
  /** Where the body is on its own time line; 0 without a body. */
  bodyTime: () => number = () => 0;
  gestures: Gestures | null = null;
  acting: Acting | null = null;
  eyes: Pick<Acting, 'attend'> | null = null;
  private readonly view: ConversationView;
  private readonly emit: Emit;
  private readonly speaking: Speaking;
  private readonly captioning: Captioning;
  private readonly connection: Connection;
  private readonly voice: VoiceInput;
  private readonly timer = new TurnTimer();
  private readonly loudness = new Loudness((gain) => (this.player.output.gain.value = gain));
  private readonly handlers: Handlers<SessionMessage> = {
    state: ({ state }) => this.show(state),
    transcript: ({ text, final }) => this.transcript(text, final),
    answer: (message) => {
      this.captioning.answer(message);
      this.view.answer(message.text);
    },
    spoken: (message) => this.captioning.spoken(message),
    speech: (message) => this.player.play(message),
    timeline: ({ utterance, points }) => this.gestures?.plan(utterance, points),
    cues: ({ utterance, cues, releases }) => {
      this.acting?.plan(utterance, [...cues, ...releases]);
      for (const { name, mirror, begin, stroke } of cues) this.emit('gesture', { utterance, name, mirror, begin, stroke });
    },
    call: ({ name, arguments: given }) => this.emit('tool-call', { name, arguments: JSON.parse(given) }),
    end: ({ utterance, samples }) => this.player.end(utterance, samples),
    stop: ({ utterance }) => {
      this.captioning.stop(utterance);
      this.player.stop(utterance);
      this.speaking.stop(utterance);
      this.acting?.stop(utterance);
    },
    pause: ({ utterance }) => {
      this.player.pause(utterance);
      this.reportHeard();
    },
    resume: ({ utterance }) => this.player.resume(utterance),
    metrics: ({ name, values }) => this.view.metrics(name, values),
    error: (message) => {
      const sentence = told(message);
      this.view.notice(sentence);
      this.emit('error', { message: english(sentence), code: codeOf(sentence), fatal: false });
    },
  };
  private state: StateMessage['state'] = 'idle'; // of the server
  private up = false; // a session is going on
  private shut = false; // the microphone, because a session was over
  private readonly wake: WakeLock;
  private readonly ending = new AbortController();
  private readonly reporting: ReturnType<typeof setInterval>;

  /**
   * @param url gives the address of the server's WebSocket
   * @param emit takes what others than the view want to know
   */
  constructor(url: () => string, view: ConversationView, emit: Emit = () => {}) {
    this.view = view;
    this.emit = emit;
    this.speaking = new Speaking(emit);
    this.connection = new Connection(url, {
      message: (message) => handle(message, this.handlers),
      welcome: (message, replaced) => this.welcome(message, replaced),
      queued: (place) => this.queued(place),
      lost: () => this.lost(),
      regained: () => this.regained(),
      stalled: (stalls) => view.line(stalls ? 'slow' : 'up'),
      ended: (ending) => this.ended(ending),
    });
    const send = this.connection.send.bind(this.connection);
    const { signal } = this.ending;
    this.captioning = new Captioning(() => this.player.heard(), view, signal);
    this.voice = new VoiceInput(send, (at) => this.player.heard(at), view, signal);
    this.voice.onChange = () => this.settleWake();
    this.wake = new WakeLock(signal);
    new SoundGuard(this.player.context, (silent) => view.silenced(silent), signal);
    this.voice.onSound = (pcm) => this.acting?.listen(pcm);
    this.player.onStart = (utterance, delay) => {
      this.answerStarts(performance.now() + 1000 * delay);
      this.speaking.start(utterance);
    };
    this.player.onFinish = (utterance, seconds) => {
      this.report(utterance, seconds);
      this.captioning.finish(utterance);
      this.speaking.finish(utterance);
    };
    this.reporting = setInterval(() => this.reportHeard(), CLOCK_PERIOD);
  }

  /** Connects, at first or after an ending; call it when sound may play. */
  start(): void {
    this.view.state('connecting');
    this.connection.open();
  }

  /** Asks a typed question; false while there is no connection. */
  ask(text: string): boolean {
    const sent = this.connection.send({ type: 'text', text });
    if (sent) {
      this.timer.asked(performance.now());
      this.view.question(text, true);
    }
    return sent;
  }

  /** Has the avatar say a text as it is, if the server allows it; false while there is no connection. */
  say(text: string): boolean {
    return this.connection.send({ type: 'say', text });
  }

  /** Starts anew with another service. */
  choose(offer: Offer): void {
    this.captioning.reset();
    this.player.reset();
    this.speaking.stop();
    this.connection.restart({ [offer.kind]: offer.key });
  }

  /** Silences the avatar at once. */
  interrupt(): void {
    const utterance = this.player.current;
    if (utterance !== null) {
      this.captioning.stop(utterance);
      this.player.stop(utterance);
      this.speaking.stop(utterance);
    }
    this.connection.send({ type: 'interrupt', utterance });
  }

  /** Ends the talk, as a server does; the visitor may begin another one. */
  hangUp(): void {
    this.connection.hangUp();
  }

  /** Opens or closes the microphone; what hinders it is shown as a notice. */
  toggleMicrophone(): Promise<void> {
    return this.voice.toggle();
  }

  /** Opens or closes the microphone, unless it is so already. */
  async setMicrophone(open: boolean): Promise<void> {
    if (this.voice.isOpen !== open) await this.voice.toggle();
  }

  /** How loud the avatar is, from 0 to 1. */
  set volume(volume: number) {
    this.loudness.volume = volume;
  }

  /** Whether the avatar is not heard: it speaks on, and moves its lips. */
  get muted(): boolean {
    return this.loudness.muted;
  }

  set muted(muted: boolean) {
    this.loudness.muted = muted;
  }

  /** Push to talk: from here to `release` all that the microphone hears is one turn. */
  press(): Promise<void> {
    return this.voice.press();
  }

  release(): void {
    this.voice.release();
  }

  /** Whether what the visitor says by the button is heard: it takes a while until the microphone is open. */
  get hearsButton(): boolean {
    return this.voice.hearsButton;
  }

  /** Whether nobody talks, listens or thinks. */
  get isQuiet(): boolean {
    return this.state === 'idle' && !this.voice.hearsButton;
  }

  /** Hangs up for good: nothing is heard, said or sent any more. */
  dispose(): void {
    clearInterval(this.reporting);
    this.close();
    this.ending.abort();
    this.connection.close();
    void this.player.context.close();
  }

  private welcome(message: WelcomeMessage, replaced: boolean): void {
    if (!message.resumed) this.silence();
    if (replaced) {
      this.shut = this.voice.isOpen;
      this.voice.close(); // what is said was meant for somebody who knew what was said before
      this.view.notice(REPLACED);
    }
    if (this.shut) this.view.notice(OFF);
    this.shut = false;
    this.up = true;
    this.view.line('up');
    this.voice.welcome(message);
    this.view.connected(message.resumed);
    this.view.services(message.services, message.offers);
    this.view.memory(message.remembers, (texts) => {
      if (!message.resumed) this.connection.send({ type: 'notes', texts: [...texts] });
    });
    this.show('idle');
    for (const notice of message.notices) this.view.notice(told(notice));
  }

  private queued(place: PlaceMessage): void {
    this.close(); // of a session of before; nobody listens yet
    this.view.line('up');
    this.view.state('queued');
    this.view.queued(place);
  }

  private lost(): void {
    this.view.line('lost');
    this.view.state('connecting');
  }

  private regained(): void {
    this.view.line('up');
    this.view.state(this.state);
  }

  private ended(ending: Ending): void {
    this.close();
    this.view.line('up'); // the ending says what there is to say
    this.view.state('ended');
    this.view.ended(ending);
  }

  /** Utterances are counted from the start again. */
  private silence(): void {
    this.captioning.reset();
    this.player.reset();
    this.speaking.stop();
    this.gestures?.reset();
    this.acting?.reset();
    this.eyes?.attend('idle');
  }

  private show(state: StateMessage['state']): void {
    this.state = state;
    this.acting?.attend(state);
    this.eyes?.attend(state);
    this.view.state(state);
    this.settleWake();
  }

  /** The screen stays on while somebody talks or may. */
  private settleWake(): void {
    this.wake.want(this.up && (this.voice.listens || this.state !== 'idle'));
  }

  /** The session is over. */
  private close(): void {
    this.up = false;
    this.shut ||= this.voice.isOpen;
    this.voice.end();
    this.silence();
    this.settleWake();
  }

  private transcript(text: string, final: boolean): void {
    this.view.question(text, final);
    if (final && this.voice.lastVoice !== null) this.timer.asked(this.voice.lastVoice);
  }

  private answerStarts(at: number): void {
    const latency = this.timer.answered(at);
    if (latency !== null) this.view.latency(latency);
  }

  private reportHeard(): void {
    const heard = this.player.heard();
    if (heard) this.report(heard.utterance, heard.seconds);
  }

  private report(utterance: number, seconds: number): void {
    const position = Math.max(0, seconds);
    this.connection.send({ type: 'clock', utterance, position, body_time: this.bodyTime() });
  }
}
