import { atEnd } from '../../lifetime.ts';
import { estimated, type Progress } from '../../talk/captioning.ts';
import { RunningSentence } from '../../talk/record.ts';
import { byId } from '../elements.ts';
import { Leaving } from './leaving.ts';

const LEAST = 8000; // ms for which nobody speaks until what was said goes
const READING = 0.5; // of the time in which it is said

/** What the visitor asked and the sentence that the avatar says, word by word as it is heard; then all that was said. */
export class Captions {
  private readonly root: HTMLElement;
  private readonly asked: HTMLElement;
  private readonly answered: HTMLElement;
  private readonly cut: HTMLElement; // tells that the answer began above what is seen of it
  private readonly heardWords = document.createElement('span');
  private readonly nextWords = document.createElement('span'); // keep their place, so that no line jumps
  private readonly sentence = new RunningSentence();
  private readonly leaving: Leaving;
  private utterance: number | null = null; // that is heard
  private quiet = false; // nobody listens, thinks or speaks
  private scrolls = false; // as soon as all is written
  private read = { text: '', time: LEAST }; // how long what was said stays

  /**
   * @param lang language of the talk; empty if it is unknown
   * @param signal ends the following of the present line
   */
  constructor(root: ParentNode, lang: string, signal: AbortSignal) {
    this.root = byId(root, 'captions');
    this.asked = byId(root, 'question');
    this.answered = byId(root, 'answer');
    this.cut = byId(root, 'cut');
    this.root.lang = lang;
    this.leaving = new Leaving(this.root, signal);
    this.nextWords.className = 'unheard';
    this.answered.append(this.heardWords, this.nextWords);
    const observer = new ResizeObserver(() => this.scroll()); // lines break anew: a phone was turned
    observer.observe(this.answered);
    atEnd(signal, () => observer.disconnect());
  }

  question(text: string, final: boolean): void {
    this.root.hidden = false;
    this.asked.textContent = text;
    this.asked.classList.toggle('partial', !final);
    if (final || this.utterance === null) this.write('', ''); // what is asked now is not what was answered
    this.settle();
  }

  heard(progress: Progress): void {
    const { text, heard } = this.sentence.follow(progress);
    this.utterance = progress.utterance;
    this.root.hidden = false;
    this.write(text.slice(0, heard), text.slice(heard));
    this.settle();
  }

  /**
   * What was not heard is not said any more.
   *
   * @param said all that was heard of the utterance
   */
  over(utterance: number, said: string): void {
    if (utterance !== this.utterance) return;
    this.utterance = null;
    this.write(said, '');
    this.settle();
  }

  /** @param quiet nobody listens, thinks or speaks: what was said goes once it could be read */
  rest(quiet: boolean): void {
    if (quiet === this.quiet) return;
    this.quiet = quiet;
    this.settle();
  }

  /** Nothing is said any more: what was said belongs to another talk. */
  clear(): void {
    this.utterance = null;
    this.asked.textContent = '';
    this.write('', '');
    this.root.hidden = true;
  }

  private settle(): void {
    const { quiet, utterance, leaving } = this;
    if (quiet && utterance === null) leaving.after(this.timeToRead());
    else leaving.stay();
  }

  private timeToRead(): number {
    const text = this.heardWords.textContent!;
    if (text !== this.read.text) this.read = { text, time: timeToRead(text) };
    return this.read.time;
  }

  private write(heard: string, next: string): void {
    // The page would find the place of a question for nothing, of which many may come.
    if (this.heardWords.textContent === heard && this.nextWords.textContent === next) return;
    this.heardWords.textContent = heard;
    this.nextWords.textContent = next;
    if (this.scrolls) return;
    this.scrolls = true;
    queueMicrotask(() => this.scroll()); // once for all that is written until then
  }

  /**
   * What is higher than its place goes by pages, which turn with the first word of the next one. Only there all words
   * of a page are seen at once, those that are still to come dimly: the last ones would go as soon as they are heard.
   */
  private scroll(): void {
    this.scrolls = false;
    const { answered, heardWords, cut } = this;
    answered.classList.toggle('paged', answered.scrollHeight - answered.clientHeight > 1);
    const last = [...heardWords.getClientRects()].at(-1);
    const down = last ? last.top - answered.getBoundingClientRect().top + answered.scrollTop : 0;
    const line = parseFloat(getComputedStyle(answered).lineHeight);
    const page = line * Math.max(1, Math.round(answered.clientHeight / line)); // pixels of the screen are too coarse
    answered.scrollTop = Math.floor(down / page) * page;
    cut.hidden = answered.scrollTop < 1;
  }
}

/** ms for which a text stays after it was said: long ones longer, as they are not read in a glance. */
export function timeToRead(text: string): number {
  const spoken = estimated(text, 0).at(-1)?.time ?? 0;
  return Math.max(LEAST, 1000 * READING * spoken);
}
