import { Microphone } from '../audio/microphone.ts';
import { Player } from '../audio/player.ts';
import type { PageError } from '../errors.ts';
import type { Offer, ServerMessage, Services, StateMessage, WelcomeMessage } from '../protocol.ts';
import { Connection } from './connection.ts';
import { TurnTimer, VoiceMeter } from './latency.ts';
import { Listening, type ListeningView } from './listening.ts';

/** Who moves the body while it speaks. */
export interface Gestures {
  /** Takes what the server planned for an utterance: (s of sound, s of body). */
  plan(utterance: number, points: readonly [number, number][]): void;
  /** Utterances are counted from the start again. */
  reset(): void;
}

const CLOCK_PERIOD = 200; // ms between reports of what has been heard
const KEPT_OPEN = 20_000; // ms after talking by the button: opening a microphone costs the first words

/** What the page shows of a conversation. */
export interface ConversationView extends ListeningView {
  state(state: StateMessage['state'] | 'connecting'): void;
  question(text: string, final: boolean): void;
  answer(sentence: string): void;
  services(services: Services, offers: readonly Offer[]): void;
  microphone(open: boolean): void;
  talking(held: boolean): void;
  latency(milliseconds: number): void;
  metrics(name: string, values: Record<string, number>): void;
  failed(error: PageError): void;
}

/** Microphone, wire and loudspeaker joined into a conversation. */
export class Conversation {
  readonly player = new Player();
  /** Where the body is on its own time line; 0 without a body. */
  bodyTime: () => number = () => 0;
  gestures: Gestures | null = null;
  private readonly view: ConversationView;
  private readonly connection: Connection;
  private readonly microphone: Microphone;
  private readonly listening: Listening;
  private readonly meter = new VoiceMeter();
  private readonly timer = new TurnTimer();
  private sample = 0; // of the microphone
  private open = false; // what the microphone hears is sent
  private held = false; // the button to talk is
  private closing: ReturnType<typeof setTimeout> | undefined;

  constructor(url: string, view: ConversationView) {
    this.view = view;
    this.connection = new Connection(url, {
      message: (message) => this.receive(message),
      welcome: (message) => this.welcome(message),
      lost: () => view.state('connecting'),
      failed: (error) => view.failed(error),
    });
    this.listening = new Listening((message) => this.connection.send(message), view);
    this.microphone = new Microphone(
      (pcm, end) => this.hear(pcm, end),
      (error) => {
        this.open = false;
        this.release();
        this.listening.close();
        view.microphone(false);
        view.notice(error.message);
      },
    );
    this.player.onStart = (_, delay) => this.answerStarts(performance.now() + 1000 * delay);
    this.player.onFinish = (utterance, seconds) => this.report(utterance, seconds);
    setInterval(() => this.reportHeard(), CLOCK_PERIOD);
  }

  /** Connects; call it when sound may play. */
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

  /** Starts anew with another service. */
  choose(offer: Offer): void {
    this.player.reset();
    this.connection.restart({ [offer.kind]: offer.key });
  }

  /** Silences the avatar at once. */
  interrupt(): void {
    const utterance = this.player.current;
    if (utterance !== null) this.player.stop(utterance);
    this.connection.send({ type: 'interrupt', utterance });
  }

  /** Opens or closes the microphone; what hinders it is shown as a notice. */
  async toggleMicrophone(): Promise<void> {
    this.open = !this.open && (await this.startMicrophone());
    this.dictate();
    if (!this.open) this.microphone.stop();
    this.view.microphone(this.open);
  }

  /** Push to talk: from here to `release` all that the microphone hears is one turn. */
  async press(): Promise<void> {
    if (this.held) return;
    this.held = true;
    clearTimeout(this.closing);
    const started = await this.startMicrophone();
    if (!this.held) return; // let go while the browser asked for the microphone
    this.held = started && this.connection.send({ type: 'talk', pressed: true });
    this.view.talking(this.held);
    this.dictate();
  }

  release(): void {
    if (!this.held) return;
    this.held = false;
    this.connection.send({ type: 'talk', pressed: false });
    this.view.talking(false);
    this.dictate();
    this.closing = setTimeout(() => this.open || this.microphone.stop(), KEPT_OPEN);
  }

  private async startMicrophone(): Promise<boolean> {
    if (this.microphone.open) return true;
    try {
      this.sample = 0;
      await this.microphone.start();
    } catch (error) {
      this.view.notice((error as Error).message);
    }
    return this.microphone.open;
  }

  /** The browser recognises speech, where it is asked to, while the server hears it too. */
  private dictate(): void {
    const track = this.open || this.held ? this.microphone.track : null;
    if (track) this.listening.open(track);
    else this.listening.close();
  }

  private hear(pcm: Int16Array, end: number): void {
    if (!this.open && !this.held) return;
    this.meter.hear(pcm, end);
    const heard = this.player.heard(end);
    const sounds = heard !== null && !heard.paused;
    this.connection.send({
      type: 'audio',
      sample: this.sample,
      pcm,
      playing: sounds ? heard.utterance : null,
      position: sounds ? Math.max(0, heard.seconds) : 0,
    });
    this.sample += pcm.length;
  }

  private welcome(message: WelcomeMessage): void {
    if (!message.resumed) {
      this.player.reset();
      this.gestures?.reset();
    }
    this.listening.welcome(message);
    this.view.services(message.services, message.offers);
    this.view.state('idle');
    for (const notice of message.notices) this.view.notice(notice);
  }

  private receive(message: ServerMessage): void {
    switch (message.type) {
      case 'state':
        return this.view.state(message.state);
      case 'transcript':
        return this.transcript(message.text, message.final);
      case 'answer':
        return this.view.answer(message.text);
      case 'speech':
        return this.player.play(message);
      case 'timeline':
        return this.gestures?.plan(message.utterance, message.points);
      case 'end':
        return this.player.end(message.utterance, message.samples);
      case 'stop':
        return this.player.stop(message.utterance);
      case 'pause':
        this.player.pause(message.utterance);
        return this.reportHeard();
      case 'resume':
        return this.player.resume(message.utterance);
      case 'metrics':
        return this.view.metrics(message.name, message.values);
      case 'error':
        return this.view.notice(message.message);
    }
  }

  private transcript(text: string, final: boolean): void {
    this.view.question(text, final);
    if (final && this.meter.lastVoice !== null) this.timer.asked(this.meter.lastVoice);
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
