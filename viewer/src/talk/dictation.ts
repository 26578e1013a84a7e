/** What is used of the Web Speech API; TypeScript does not know it. */
export interface Recognition extends EventTarget {
  continuous: boolean;
  interimResults: boolean;
  lang: string;
  onresult: ((event: RecognitionResults) => void) | null;
  onerror: ((event: { error: string }) => void) | null;
  onend: (() => void) | null;
  /** Older browsers ignore the track and take the microphone as it is, without echo cancellation. */
  start(track?: MediaStreamTrack): void;
  /** No more is recorded; results of what was recorded come still. */
  stop(): void;
  abort(): void;
}

/** Results since the recogniser was started; those from `resultIndex` on are news. */
interface RecognitionResults {
  resultIndex: number;
  results: ArrayLike<ArrayLike<{ transcript: string }> & { isFinal: boolean }>;
}

type RecognitionMaker = new () => Recognition;

const PASSING = ['no-speech', 'aborted']; // errors after which it goes on
const RESTART = 250; // ms
const MOST_VAIN_STARTS = 8; // in a row, without a word or a second of listening
const VAIN = 1000; // ms

/** The browser's recogniser, if it has one. */
export function recognitionOf(scope: object = window): RecognitionMaker | null {
  const names = scope as Record<string, RecognitionMaker | undefined>;
  return names['SpeechRecognition'] ?? names['webkitSpeechRecognition'] ?? null;
}

/** Lets the browser recognise what the visitor says, for as long as the microphone is open. */
export class Dictation {
  private readonly recognition: Recognition;
  private readonly heard: (result: number, text: string, final: boolean) => void;
  private readonly failed: (reason: string) => void;
  private track: MediaStreamTrack | null = null; // null: not to listen
  private running = false; // stays so after `stop` until the last words have come
  private first = 0; // number of the first result since the last start
  private next = 0;
  private started = 0;
  private vain = 0;
  private restart: ReturnType<typeof setTimeout> | undefined;

  /**
   * @param language BCP 47 tag, empty for the browser's own
   * @param heard takes the words of a result; the same number comes again until they are final
   * @param failed it does not work here, and has stopped
   */
  constructor(
    Maker: RecognitionMaker,
    language: string,
    heard: (result: number, text: string, final: boolean) => void,
    failed: (reason: string) => void,
  ) {
    this.heard = heard;
    this.failed = failed;
    this.recognition = new Maker();
    this.recognition.continuous = true;
    this.recognition.interimResults = true;
    if (language) this.recognition.lang = language;
    this.recognition.onresult = (event) => this.take(event);
    this.recognition.onerror = ({ error }) => {
      if (!PASSING.includes(error)) this.fail(error);
    };
    this.recognition.onend = () => this.ended();
  }

  start(track: MediaStreamTrack): void {
    this.track = track;
    this.vain = 0;
    if (!this.running) this.begin();
  }

  stop(): void {
    if (!this.track) return;
    this.track = null;
    clearTimeout(this.restart);
    this.recognition.stop();
  }

  private begin(): void {
    clearTimeout(this.restart);
    this.first = this.next;
    this.started = performance.now();
    try {
      this.recognition.start(this.track!);
      this.running = true;
    } catch (error) {
      this.fail((error as Error).name);
    }
  }

  private take({ resultIndex, results }: RecognitionResults): void {
    this.vain = 0;
    for (let index = resultIndex; index < results.length; index++) {
      const result = results[index]!;
      this.next = Math.max(this.next, this.first + index + 1);
      const text = result[0]!.transcript.trim();
      if (text) this.heard(this.first + index, text, result.isFinal);
    }
  }

  /** Browsers end by themselves, after a sentence or a minute of silence. */
  private ended(): void {
    this.running = false;
    if (!this.track) return;
    this.vain = performance.now() - this.started < VAIN ? this.vain + 1 : 0;
    if (this.vain >= MOST_VAIN_STARTS) this.fail('it ends at once');
    else this.restart = setTimeout(() => this.begin(), RESTART);
  }

  private fail(reason: string): void {
    if (!this.track) return;
    this.track = null;
    this.recognition.abort();
    this.failed(reason);
  }
}
