import { Microphone } from '../audio/microphone.ts';
import { watchBlocked } from '../audio/permission.ts';
import { sentenceOf } from '../errors.ts';
import type { Heard } from '../face/face.ts';
import { MICROPHONE_RATE, type ClientMessage, type WelcomeMessage } from '../protocol.ts';
import { codeOf, say, type Sentence } from '../words/text.ts';
import { VoiceMeter } from './latency.ts';
import { Listening, type ListeningView } from './listening.ts';
import { Recovery } from './recovery.ts';

const AGAIN = say('microphone.again');
const EARLY = say('microphone.early');
const SOME_WORDS = 500; // ms: who holds the button so long before the microphone is open has said something
const SILENCE = { pieces: 10, milliseconds: 100 }; // that is told when the microphone closes
const KEPT_OPEN = 20_000; // ms after talking by the button: opening a microphone costs the first words

export type MicrophoneState = 'closed' | 'opening' | 'open';
/** As the page shows it: closed, and blocked for the page. */
export type ShownMicrophone = MicrophoneState | 'blocked';

/** What the page shows of the visitor's voice. */
export interface VoiceView extends ListeningView {
  microphone(state: ShownMicrophone): void;
  talking(held: boolean): void;
}

/** What the visitor says: the microphone and the button to talk, on their way to the server. */
export class VoiceInput {
  /** Takes the visitor's sound while it is sent. */
  onSound: (pcm: Int16Array) => void = () => {};
  /** Called when it may listen, or not any more. */
  onChange: () => void = () => {};
  private readonly send: (message: ClientMessage) => boolean;
  private readonly heard: (at: number) => Heard | null;
  private readonly view: VoiceView;
  private readonly microphone: Microphone;
  private readonly listening: Listening;
  private readonly recovery: Recovery;
  private readonly meter = new VoiceMeter();
  private ended = false; // the session is: nothing opens
  private sample = 0; // since the microphone opened
  private state: MicrophoneState = 'closed'; // open: what it hears is sent
  private blocked = false; // the microphone, for this page
  private held = false; // the button to talk is
  private talking = false; // and the server was told
  private letGo = 0; // when it was, ms on the performance clock
  private closing: ReturnType<typeof setTimeout> | undefined;
  private silence: ReturnType<typeof setInterval> | undefined;

  /** @param heard what leaves the loudspeaker at a moment of the performance clock */
  constructor(
    send: (message: ClientMessage) => boolean,
    heard: (at: number) => Heard | null,
    view: VoiceView,
    signal: AbortSignal,
  ) {
    this.send = send;
    this.heard = heard;
    this.view = view;
    this.listening = new Listening(send, view);
    this.microphone = new Microphone(
      (pcm, end) => this.hear(pcm, end),
      (error) => {
        const wanted = this.state === 'open';
        this.close();
        view.notice(sentenceOf(error));
        if (wanted) this.recovery.lost();
      },
    );
    this.recovery = new Recovery({ isOpen: () => this.state === 'open', reopen: () => this.reopen() }, signal);
    void watchBlocked((blocked) => this.block(blocked), signal);
  }

  /** When the visitor last spoke, ms on the performance clock. */
  get lastVoice(): number | null {
    return this.meter.lastVoice;
  }

  /** Whether the microphone is on, or about to be. */
  get isOpen(): boolean {
    return this.state !== 'closed';
  }

  /** Whether what is said while the button is held is sent. */
  get hearsButton(): boolean {
    return this.talking;
  }

  /** Whether what the visitor says is sent. */
  get listens(): boolean {
    return this.state === 'open' || this.talking;
  }

  /** Opens or closes the microphone; what hinders it is shown as a notice. */
  async toggle(): Promise<void> {
    if (this.ended || this.state === 'opening') return;
    this.recovery.cancel();
    if (this.state === 'open') {
      this.fallSilent();
      this.show('closed');
    } else {
      this.show('opening');
      this.show((await this.start()) ? 'open' : 'closed');
    }
    this.settle(0);
  }

  /** Push to talk: from here to `release` all that the microphone hears is one turn. */
  async press(): Promise<void> {
    if (this.ended || this.held) return;
    this.held = true;
    const pressed = performance.now();
    const open = await this.start();
    const until = this.held ? performance.now() : this.letGo;
    if (open && until - pressed > SOME_WORDS) this.view.notice(EARLY);
    // The button may be up again, or down for the second time: browsers take their time to ask.
    if (this.held && !this.talking) this.talking = open && this.send({ type: 'talk', pressed: true });
    this.held = this.talking;
    this.settle(KEPT_OPEN);
  }

  release(): void {
    if (this.held) this.letGo = performance.now();
    this.held = false;
    if (!this.talking) return;
    this.talking = false;
    this.send({ type: 'talk', pressed: false });
    this.settle(KEPT_OPEN);
  }

  /** Closes the microphone. */
  close(): void {
    this.recovery.cancel();
    this.release();
    this.microphone.stop();
    this.show('closed');
    this.settle(0);
  }

  /** The session is over. */
  end(): void {
    this.close();
    this.ended = true;
  }

  /** The line is up. */
  welcome(message: WelcomeMessage): void {
    this.ended = false;
    // What was sent may have been lost with the line: the server is told where the button is.
    if (message.resumed || this.talking) this.send({ type: 'talk', pressed: this.talking });
    this.listening.welcome(message);
  }

  private async start(notice = (sentence: Sentence) => this.view.notice(sentence)): Promise<boolean> {
    clearTimeout(this.closing);
    if (this.microphone.open) return true;
    this.sample = 0;
    try {
      const open = await this.microphone.start();
      if (open) void this.recovery.opened();
      if (open) this.block(false);
      return open;
    } catch (error) {
      const sentence = sentenceOf(error);
      if (codeOf(sentence) === 'microphone.blocked') this.block(true);
      notice(sentence);
      return false;
    }
  }

  /** Opens the microphone as the visitor had it; true also where there is nothing to do. */
  private async reopen(): Promise<boolean> {
    if (this.ended || this.talking || this.state === 'opening') return true;
    this.microphone.stop();
    this.listening.close();
    this.show('opening');
    const open = await this.start(() => {}); // why it closed was told
    if ((this.state as MicrophoneState) !== 'opening') return true; // closed meanwhile
    this.show(open ? 'open' : 'closed');
    this.settle(0);
    if (open) this.view.notice(AGAIN);
    return open;
  }

  /** What was said until the microphone closed is a turn: silence ends it, as when somebody stops talking. */
  private fallSilent(): void {
    if (this.talking || this.meter.lastVoice === null) return;
    let { pieces } = SILENCE;
    clearInterval(this.silence);
    this.silence = setInterval(() => {
      if (pieces-- === 0 || this.isOpen || this.talking || this.ended) return clearInterval(this.silence);
      const pcm = new Int16Array((MICROPHONE_RATE * SILENCE.milliseconds) / 1000);
      this.send({ type: 'audio', sample: this.sample, pcm, playing: null, position: 0 });
      this.sample += pcm.length;
    }, SILENCE.milliseconds);
  }

  private show(state: MicrophoneState): void {
    this.state = state;
    this.view.microphone(state === 'closed' && this.blocked ? 'blocked' : state);
    this.onChange();
  }

  private block(blocked: boolean): void {
    if (blocked === this.blocked) return;
    this.blocked = blocked;
    if (this.state === 'closed') this.show('closed');
  }

  /**
   * Makes everything follow from who wants to be heard.
   *
   * @param kept ms after which a microphone that nobody wants closes
   */
  private settle(kept: number): void {
    this.view.talking(this.talking);
    this.onChange();
    clearTimeout(this.closing);
    const track = this.state === 'open' || this.talking ? this.microphone.track : null;
    if (track) this.listening.open(track);
    else {
      this.listening.close();
      if (kept > 0) this.closing = setTimeout(() => this.microphone.stop(), kept);
      else this.microphone.stop();
    }
  }

  private hear(pcm: Int16Array, end: number): void {
    const { sample } = this;
    this.sample += pcm.length; // also of what is not sent
    if (this.state !== 'open' && !this.talking) return;
    this.meter.hear(pcm, end);
    this.onSound(pcm);
    const heard = this.heard(end);
    const sounds = heard !== null && !heard.paused;
    const playing = sounds ? heard.utterance : null;
    const position = sounds ? Math.max(0, heard.seconds) : 0;
    this.send({ type: 'audio', sample, pcm, playing, position });
  }
}
