import type { Progress } from '../../talk/captioning.ts';
import { newest, TalkRecord, type Entry } from '../../talk/record.ts';
import type { PageWords } from '../../words/page-words.ts';
import { say, type Sentence } from '../../words/text.ts';
import { copyText, plain, saveText } from './clipboard.ts';
import { Disclosure } from './disclosure.ts';
import { keepUp, type TalkStore } from './kept-talk.ts';
import { byId } from '../elements.ts';
import { icon } from '../icons.ts';
import { isFor, isForOthers } from '../keyboard/keys.ts';

const TOLD = 4000; // ms for which it says what a button has done
/** Entries, and letters of these, that screen readers are told at once, the newest ones. */
const MOST_ANNOUNCED = 20;
const MOST_LETTERS = 10_000;
const END = 40; // pixels from the lower end within which the record follows what is said

/** Who talks. */
export interface Talker {
  name: string;
  /** Languages of the talk, BCP 47, the usual one first; none if they are unknown. */
  languages: readonly string[];
  /** Questions that are proposed to visitors. */
  suggestions: readonly string[];
  /** Address of its server. */
  home: string;
  /** Where its lines stay once a talk is over. */
  kept: TalkStore;
}

/** The drawer with all that was said, and what screen readers hear of it; where it is kept, also of talks before. */
export class Transcript {
  readonly record: TalkRecord;
  private readonly page: HTMLElement;
  private readonly words: PageWords;
  private readonly talker: Talker;
  private readonly list: HTMLElement;
  private readonly rows = new Map<Entry, HTMLElement>();
  private began = new Date(); // the talk
  private recalls = false; // the avatar was told what the visitor said in earlier ones
  private announced = 0; // entries that screen readers have heard
  private readonly news = new Set<Entry>(); // not drawn yet
  private anew = false; // all is to be drawn
  private drawing: number | undefined; // the request for it
  private readonly keep: () => void;
  private readonly cleared: () => void;

  /** @param cleared called when the visitor wants nothing of what was said to be seen */
  constructor(page: HTMLElement, words: PageWords, talker: Talker, cleared: () => void, signal: AbortSignal) {
    this.page = page;
    this.words = words;
    this.talker = talker;
    this.cleared = cleared;
    this.list = byId(page, 'record');
    const events = { changed: (entry: Entry) => this.changed(entry), dropped: (entry: Entry) => this.dropped(entry), renewed: () => this.renewed() };
    this.record = new TalkRecord(events, talker.kept.read());
    this.keep = keepUp(talker.kept, () => this.record.lasting, signal);
    byId(page, 'drawer-kept').hidden = !talker.kept.outlastsPage;
    const clear = byId(page, 'drawer-clear');
    words.write(clear, say('transcript.clear.title', { name: talker.name }), 'title');
    clear.onclick = () => this.clear();
    byId(page, 'drawer-copy').onclick = () => void this.copy();
    byId(page, 'drawer-save').onclick = () => saveText(this.text(), this.fileName());
    words.onChange(() => this.draw(), signal);
    const drawer = new Disclosure(page, 'drawer', signal, (open) => this.opened(open));
    const press = (event: KeyboardEvent) => isFor('transcript', event) && this.isOffered && !isForOthers(event) && drawer.toggle();
    page.addEventListener('keydown', press, { signal });
    this.draw();
  }

  /** There is somebody to talk with. */
  offer(): void {
    const button = byId(this.page, 'drawer-button');
    button.append(icon('record'));
    button.hidden = false;
  }

  private get isOpen(): boolean {
    return this.page.hasAttribute('data-drawer');
  }

  private get isOffered(): boolean {
    return !byId(this.page, 'drawer-button').hidden;
  }

  heard(progress: Progress): void {
    this.record.heard(progress);
  }

  /** The server has ended the talk: its lines stay until the next one begins, which may be somebody else's. */
  close(): void {
    this.record.close();
    this.talker.kept.write([]);
  }

  /** Says of earlier talks whether the avatar was told what the visitor said in them. */
  showRecall(recalls: boolean): void {
    if (recalls === this.recalls) return;
    this.recalls = recalls;
    this.draw();
  }

  /**
   * Tells screen readers what was said since it was told last; while somebody speaks it would be talked over.
   *
   * @param wanted whether the visitor wants to hear it
   */
  announce(wanted: boolean): void {
    const news = this.record.entries.slice(this.announced);
    if (news.length === 0 || this.record.isOpen) return;
    this.announced += news.length;
    if (wanted) byId(this.page, 'announcer').replaceChildren(...newest(news, MOST_ANNOUNCED, MOST_LETTERS).map((entry) => this.paragraph(this.line(entry))));
  }

  private opened(open: boolean): void {
    this.page.toggleAttribute('data-drawer', open);
    if (!open) return;
    this.list.scrollTop = this.list.scrollHeight;
    this.list.focus({ preventScroll: true });
  }

  private clear(): void {
    this.record.clear();
    this.draw(); // who cleared it sees so
    this.talker.kept.write([]);
    this.cleared();
    this.tell(say('transcript.cleared', { name: this.talker.name }));
  }

  private renewed(): void {
    this.began = new Date();
    this.announced = 0;
    byId(this.page, 'announcer').replaceChildren();
    this.anew = true;
    this.drawSoon();
  }

  /** Draws what is new, once for all that comes until the next picture: each time the page finds the place of everything. */
  private drawSoon(): void {
    this.drawing ??= requestAnimationFrame(() => {
      this.drawing = undefined;
      if (this.anew) return this.draw();
      const { list } = this;
      const follows = this.isOpen && list.scrollHeight - list.scrollTop - list.clientHeight < END;
      for (const entry of this.news) this.show(entry);
      this.news.clear();
      if (follows) list.scrollTop = list.scrollHeight;
    });
  }

  private draw(): void {
    this.anew = false;
    this.news.clear();
    this.rows.clear();
    const { earlier, entries } = this.record;
    const before = [this.divider(this.aboutEarlier()), ...earlier.map((entry) => this.row(entry)), this.divider(this.aboutNow())];
    this.list.replaceChildren(...(earlier.length > 0 ? before : entries.length === 0 ? [this.note()] : []));
    for (const entry of entries) this.show(entry);
  }

  private changed(entry: Entry): void {
    this.news.add(entry);
    this.drawSoon();
    this.keep();
  }

  private dropped(entry: Entry): void {
    this.news.delete(entry);
    this.rows.get(entry)?.remove();
    this.rows.delete(entry);
    this.announced = Math.max(0, this.announced - 1);
  }

  private show(entry: Entry): void {
    const row = this.rows.get(entry) ?? this.add(entry);
    row.lastElementChild!.textContent = entry.text;
  }

  private add(entry: Entry): HTMLElement {
    const row = this.row(entry);
    if (this.rows.size === 0 && this.record.earlier.length === 0) this.list.replaceChildren();
    this.list.append(row);
    this.rows.set(entry, row);
    return row;
  }

  private row(entry: Entry): HTMLElement {
    const row = document.createElement('div');
    row.className = entry.who;
    const who = document.createElement('strong');
    who.textContent = this.nameOf(entry);
    const time = document.createElement('time');
    time.dateTime = entry.at.toISOString();
    time.textContent = this.clock(entry.at);
    row.append(who, ' ', time, this.paragraph(entry.text));
    (row.lastElementChild as HTMLElement).lang = this.talker.languages[0] ?? '';
    return row;
  }

  private divider(text: string): HTMLElement {
    const line = this.paragraph(text);
    line.className = 'divider';
    return line;
  }

  /** What stands over talks before this one. */
  private aboutEarlier(): string {
    const { name } = this.talker;
    return this.words.text(this.recalls ? say('transcript.earlier') : say('transcript.forgotten', { name }));
  }

  /** What stands over this talk, after others. */
  private aboutNow(): string {
    return `${this.words.text(say('transcript.new'))} · ${this.clock(this.began)}`;
  }

  private note(): HTMLElement {
    const note = this.paragraph(this.words.text(say('transcript.empty')));
    note.className = 'remark';
    return note;
  }

  private paragraph(text: string): HTMLElement {
    const paragraph = document.createElement('p');
    paragraph.textContent = text;
    return paragraph;
  }

  private nameOf({ who }: Entry): string {
    return who === 'you' ? this.words.text(say('transcript.you')) : this.talker.name;
  }

  private line(entry: Entry): string {
    return this.words.text(say('transcript.said', { who: this.nameOf(entry), text: entry.text }));
  }

  /** The time of a day; of another day than this one, with it. */
  private clock(at: Date): string {
    const isToday = at.toDateString() === new Date().toDateString();
    return at.toLocaleString(this.words.language, { timeStyle: 'short', dateStyle: isToday ? undefined : 'short' });
  }

  /** All as a text: its title, and a line for each time that somebody spoke. */
  private text(): string {
    const { earlier, entries } = this.record;
    const written = (lines: readonly Entry[]) => lines.map((entry) => `[${this.clock(entry.at)}] ${this.line(entry)}`);
    const before = earlier.length > 0 ? [this.aboutEarlier(), ...written(earlier), '', this.aboutNow()] : [];
    const day = this.began.toLocaleDateString(this.words.language, { dateStyle: 'long' });
    return plain([`${this.talker.name}, ${day}`, '', ...before, ...written(entries), ''].join('\n'));
  }

  private fileName(): string {
    const day = this.began.toLocaleDateString('sv'); // 2026-01-31
    return `${this.talker.name} ${this.words.text(say('transcript.file'))} ${day}.txt`.replace(/[/\\:*?"<>|]/g, '-');
  }

  private async copy(): Promise<void> {
    const copied = await copyText(this.text(), byId(this.page, 'drawer'));
    this.tell(say(copied ? 'transcript.copied' : 'transcript.uncopied'));
  }

  /** Says for some seconds what a button has done. */
  private tell(sentence: Sentence): void {
    const told = byId(this.page, 'drawer-told');
    this.words.write(told, sentence);
    setTimeout(() => this.words.write(told, ''), TOLD);
  }
}
