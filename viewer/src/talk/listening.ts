import type { ClientMessage, WelcomeMessage } from '../protocol.ts';
import { serviceName } from '../words/services.ts';
import { say, type Sentence } from '../words/text.ts';
import { Dictation, recognitionOf } from './dictation.ts';

/** What the page shows of who listens. */
export interface ListeningView {
  notice(sentence: Sentence): void;
  /** Whether the browser's maker may receive what is said. */
  sharesVoice(shared: boolean): void;
}

/** Lets the browser recognise speech where the server asks for it, else says why not. */
export class Listening {
  private readonly send: (message: ClientMessage) => boolean;
  private readonly view: ListeningView;
  private readonly Maker: ReturnType<typeof recognitionOf>;
  private dictation: Dictation | null = null;
  private fallback: string | null = null;
  private deaf: string | null = null; // why the browser does not do it
  private track: MediaStreamTrack | null = null;

  constructor(send: (message: ClientMessage) => boolean, view: ListeningView, Maker = recognitionOf()) {
    this.send = send;
    this.view = view;
    this.Maker = Maker;
  }

  /** The line is up; a new session has not heard of what this browser cannot do. */
  welcome({ dictation, resumed }: WelcomeMessage): void {
    this.fallback = dictation?.fallback ?? null;
    if (!dictation) this.end();
    else if (this.deaf !== null) resumed || this.send({ type: 'deaf', reason: this.deaf });
    else if (!this.Maker) this.fail('there is none');
    else this.begin(this.Maker, dictation.language);
  }

  /** The microphone is open. */
  open(track: MediaStreamTrack): void {
    this.track = track;
    this.dictation?.start(track);
  }

  /** The microphone is closed. */
  close(): void {
    this.track = null;
    this.dictation?.stop();
  }

  private begin(Maker: NonNullable<typeof this.Maker>, language: string): void {
    if (this.dictation) return;
    this.dictation = new Dictation(
      Maker,
      language,
      (result, text, final) => this.send({ type: 'heard', result, text, final }),
      (reason) => this.fail(reason),
    );
    this.view.sharesVoice(true);
    if (this.track) this.dictation.start(this.track);
  }

  private end(): void {
    this.dictation?.stop();
    this.dictation = null;
    this.view.sharesVoice(false);
  }

  private fail(reason: string): void {
    this.end();
    this.deaf = reason;
    this.send({ type: 'deaf', reason });
    this.view.notice(this.fallback ? say('dictation.server', { name: serviceName(this.fallback) }) : say('dictation.typing'));
  }
}
