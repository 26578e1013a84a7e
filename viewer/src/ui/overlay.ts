import type { Part } from '../bundle/load.ts';
import { nameOf, type Manifest } from '../bundle/manifest.ts';
import { smallPicture } from '../bundle/thumbnail.ts';
import { atEnd } from '../lifetime.ts';
import type { PlaceMessage } from '../protocol.ts';
import type { Ending } from '../talk/connection.ts';
import { foreignTo } from '../words/foreign.ts';
import type { PageWords } from '../words/page-words.ts';
import { say, type Sentence } from '../words/text.ts';
import { byId, focusOn } from './elements.ts';
import { headInThumbnail } from './portrait.ts';
import { inWords } from './queue.ts';

/** How the visitor wants to talk. */
export type Choice = 'voice' | 'typing';

/** The first screen: picture, progress, the button that lets sound play, or what went wrong and a way on. */
export class Overlay {
  private readonly page: HTMLElement;
  private readonly root: HTMLElement;
  private readonly bar: HTMLProgressElement;
  private readonly coming: HTMLElement;
  private readonly thumbnail: HTMLImageElement;
  private readonly waiting: HTMLElement;
  private readonly button: HTMLButtonElement;
  private readonly words: PageWords;
  private readonly reload: () => void;
  private readonly signal: AbortSignal;
  private accepted: (choice: Choice) => void = () => {};
  private queued = false;
  private counting: ReturnType<typeof setTimeout> | undefined;

  /**
   * @param page what the overlay covers
   * @param reload loads everything anew
   */
  constructor(page: HTMLElement, words: PageWords, signal: AbortSignal, reload: () => void) {
    this.page = page;
    this.words = words;
    this.root = byId(page, 'overlay');
    this.bar = byId(page, 'progress');
    this.coming = byId(page, 'coming');
    this.thumbnail = byId(page, 'thumbnail');
    this.waiting = byId(page, 'overlay-wait');
    this.button = byId(page, 'again');
    this.reload = reload;
    this.signal = signal;
    this.cover(true);
    atEnd(signal, () => clearTimeout(this.counting));
  }

  /**
   * Tells who is coming.
   *
   * @param thumbnail address of the bundle's
   */
  greet(manifest: Manifest, thumbnail: string): void {
    byId(this.root, 'overlay-name').textContent = nameOf(manifest);
    const crop = headInThumbnail(manifest);
    if (crop) this.thumbnail.style.transform = `scale(${1 / crop.side}) translate(${-100 * crop.left}%, ${-100 * crop.top}%)`;
    void this.picture(thumbnail);
    this.tellLanguages(manifest);
    this.words.onChange(() => this.tellLanguages(manifest), this.signal);
  }

  private async picture(thumbnail: string): Promise<void> {
    const small = await smallPicture(thumbnail, this.signal);
    if (!small) return;
    const address = URL.createObjectURL(small);
    this.thumbnail.onload = () => {
      URL.revokeObjectURL(address);
      this.thumbnail.hidden = false;
    };
    this.thumbnail.src = address;
  }

  /** Says which languages somebody speaks who does not speak the page's. */
  private tellLanguages(manifest: Manifest): void {
    const languages = foreignTo(this.words.language, manifest.persona.languages);
    const told = byId(this.root, 'speaks');
    told.hidden = languages.length === 0;
    if (languages.length > 0) this.words.write(told, say('start.speaks', { name: nameOf(manifest), languages }));
  }

  /** @param coming what is on its way */
  progress(fraction: number, coming: Part | null): void {
    this.bar.value = fraction;
    const sentence = say(`coming.${coming ?? 'all'}`);
    this.words.write(this.coming, sentence);
    this.words.write(this.bar, sentence, 'valuetext');
  }

  /**
   * Resolves when the visitor chooses; browsers play sound only after such a click.
   *
   * @param usable what of the page may be used meanwhile
   */
  choose(usable: readonly HTMLElement[] = []): Promise<Choice> {
    this.bar.hidden = this.coming.hidden = true;
    byId(this.root, 'choices').hidden = false;
    const start = byId<HTMLButtonElement>(this.root, 'start');
    start.onclick = () => this.accept('voice');
    byId(this.root, 'start-typing').onclick = () => this.accept('typing');
    for (const element of usable) element.inert = false;
    this.page.addEventListener('mousedown', (event) => this.keepFocus(event), { signal: this.signal });
    focusOn(start);
    return new Promise((resolve) => (this.accepted = resolve));
  }

  /** The visitor has chosen, by whatever was clicked. */
  accept(choice: Choice): void {
    this.accepted(choice);
  }

  /** Until the talk begins, a click on the picture leaves the focus where it is: mostly at the button that begins it. */
  private keepFocus(event: MouseEvent): void {
    if (this.isShown && !(event.target as Element).closest('header, button, a, form')) event.preventDefault();
  }

  get isShown(): boolean {
    return !this.root.inert;
  }

  hide(): void {
    this.queued = false;
    this.root.classList.add('gone');
    this.cover(false);
  }

  /** The page cannot go on; only loading it anew may help. */
  fail(sentence: Sentence): void {
    this.say(sentence, say('reload'), () => this.reload());
  }

  /** Nobody is admitted without a key: the visitor may type one. */
  askKey(sentence: Sentence, unlock: (key: string) => void): void {
    this.show(sentence);
    const form = byId<HTMLFormElement>(this.root, 'unlock');
    const input = byId<HTMLInputElement>(this.root, 'key');
    form.hidden = false;
    form.onsubmit = (event) => {
      event.preventDefault();
      unlock(input.value.trim());
    };
    input.focus();
  }

  /**
   * A session is over.
   *
   * @param again begins a new one
   */
  end({ sentence, again: mayBegin, wait }: Ending, again: () => void): void {
    if (!mayBegin) return this.fail(sentence);
    this.say(sentence, say(wait === null ? 'again.talk' : 'again.try'), () => {
      this.count(0);
      again();
    });
    if (wait !== null) this.count(Math.round(wait / 1000));
  }

  /** All places are taken: the visitor waits, and the talk begins by itself. */
  queue(place: PlaceMessage): void {
    this.show(inWords(place));
    this.button.hidden = true;
    this.waiting.hidden = false;
    this.words.write(this.waiting, say('queue.open'));
    this.queued = true;
  }

  /** The line is down; a place in the queue is kept for a while. */
  reconnect(): void {
    if (this.queued) this.words.write(this.waiting, say('queue.kept'));
  }

  private say(sentence: Sentence, label: Sentence, act: () => void): void {
    this.show(sentence);
    this.waiting.hidden = true;
    this.words.write(this.button, label);
    this.button.onclick = act;
    this.button.hidden = false;
    focusOn(this.button);
  }

  /** Covers the page with a sentence. */
  private show(sentence: Sentence): void {
    this.bar.hidden = this.coming.hidden = byId(this.root, 'choices').hidden = true;
    const text = byId(this.root, 'overlay-error');
    this.words.write(text, sentence);
    text.hidden = byId(this.root, 'check').hidden = false;
    clearTimeout(this.counting);
    this.queued = false;
    this.root.classList.remove('gone');
    this.cover(true);
  }

  /** Shows the seconds until the next try; at 0 it is made. */
  private count(seconds: number): void {
    clearTimeout(this.counting);
    this.waiting.hidden = false;
    this.words.write(this.waiting, seconds > 0 ? say('again.soon', { n: seconds }) : say('state.connecting'));
    if (seconds > 0) this.counting = setTimeout(() => this.count(seconds - 1), 1000);
  }

  /** Whether the overlay is all that a keyboard reaches. */
  private cover(covered: boolean): void {
    for (const element of this.page.children) {
      (element as HTMLElement).inert = (element === this.root) !== covered;
    }
  }
}
