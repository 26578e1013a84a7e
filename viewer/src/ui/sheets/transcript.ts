import type { Progress } from '../../talk/captioning.ts';
import { TalkRecord, type Entry } from '../../talk/record.ts';
import type { PageWords } from '../../words/page-words.ts';
import { say } from '../../words/text.ts';
import { copyText, saveText } from './clipboard.ts';
import { Disclosure } from './disclosure.ts';
import { byId } from '../elements.ts';
import { icon } from '../icons.ts';
import { isForOthers } from '../keys.ts';

const TOLD = 3000; // ms for which it says that it has copied
const END = 40; // pixels from the lower end within which the record follows what is said

/** Who talks. */
export interface Talker {
  name: string;
  /** Languages of the talk, BCP 47, the usual one first; none if they are unknown. */
  languages: readonly string[];
  /** Address of its server. */
  home: string;
}

/** The drawer with all that was said, and what screen readers hear of it. */
export class Transcript {
  readonly record: TalkRecord;
  private readonly page: HTMLElement;
  private readonly words: PageWords;
  private readonly talker: Talker;
  private readonly list: HTMLElement;
  private readonly rows = new Map<Entry, HTMLElement>();
  private began: Date | null = null; // the talk, after another one
  private announced = 0; // entries that screen readers have heard

  constructor(page: HTMLElement, words: PageWords, talker: Talker, signal: AbortSignal) {
    this.page = page;
    this.words = words;
    this.talker = talker;
    this.list = byId(page, 'record');
    this.record = new TalkRecord({ changed: (entry) => this.changed(entry), cleared: () => this.cleared() });
    byId(page, 'drawer-copy').onclick = () => void this.copy();
    byId(page, 'drawer-save').onclick = () => saveText(this.text(), this.fileName());
    words.onChange(() => this.draw(), signal);
    const drawer = new Disclosure(page, 'drawer', signal, (open) => this.opened(open));
    const press = (event: KeyboardEvent) => event.key.toLowerCase() === 't' && !isForOthers(event) && drawer.toggle();
    page.addEventListener('keydown', press, { signal });
    this.draw();
  }

  /** There is somebody to talk with. */
  offer(): void {
    const button = byId(this.page, 'drawer-button');
    button.append(icon('record'));
    button.hidden = false;
  }

  heard(progress: Progress): void {
    this.record.heard(progress);
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
    if (wanted) byId(this.page, 'announcer').replaceChildren(...news.map((entry) => this.paragraph(this.line(entry))));
  }

  private opened(open: boolean): void {
    this.page.toggleAttribute('data-drawer', open);
    if (!open) return;
    this.list.scrollTop = this.list.scrollHeight;
    this.list.focus({ preventScroll: true });
  }

  private cleared(): void {
    if (this.rows.size > 0) this.began = new Date();
    this.announced = 0;
    byId(this.page, 'announcer').replaceChildren();
    this.draw();
  }

  private draw(): void {
    this.rows.clear();
    this.list.replaceChildren();
    const { entries } = this.record;
    if (this.began) this.list.append(this.divider(this.began));
    else if (entries.length === 0) this.list.append(this.note());
    for (const entry of entries) this.changed(entry);
  }

  private changed(entry: Entry): void {
    const { list } = this;
    const follows = list.scrollHeight - list.scrollTop - list.clientHeight < END;
    const row = this.rows.get(entry) ?? this.add(entry);
    row.lastElementChild!.textContent = entry.text;
    if (follows) list.scrollTop = list.scrollHeight;
  }

  private add(entry: Entry): HTMLElement {
    const row = document.createElement('div');
    row.className = entry.who;
    const who = document.createElement('strong');
    who.textContent = this.nameOf(entry);
    const time = document.createElement('time');
    time.dateTime = entry.at.toISOString();
    time.textContent = this.clock(entry.at);
    row.append(who, ' ', time, this.paragraph(entry.text));
    (row.lastElementChild as HTMLElement).lang = this.talker.languages[0] ?? '';
    if (this.rows.size === 0 && !this.began) this.list.replaceChildren();
    this.list.append(row);
    this.rows.set(entry, row);
    return row;
  }

  private divider(at: Date): HTMLElement {
    const line = this.paragraph(`${this.words.text(say('transcript.new'))} · ${this.clock(at)}`);
    line.className = 'divider';
    return line;
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

  private clock(at: Date): string {
    return at.toLocaleTimeString(this.words.language, { timeStyle: 'short' });
  }

  /** The talk as a text: its title, and a line for each time that somebody spoke. */
  private text(): string {
    const { entries } = this.record;
    const day = (entries[0]?.at ?? new Date()).toLocaleDateString(this.words.language, { dateStyle: 'long' });
    return [`${this.talker.name}, ${day}`, '', ...entries.map((entry) => `[${this.clock(entry.at)}] ${this.line(entry)}`), ''].join('\n');
  }

  private fileName(): string {
    const day = (this.record.entries[0]?.at ?? new Date()).toLocaleDateString('sv'); // 2026-01-31
    return `${this.talker.name} ${this.words.text(say('transcript.file'))} ${day}.txt`.replace(/[/\\:*?"<>|]/g, '-');
  }

  private async copy(): Promise<void> {
    const copied = await copyText(this.text(), byId(this.page, 'drawer'));
    const told = byId(this.page, 'drawer-told');
    this.words.write(told, say(copied ? 'transcript.copied' : 'transcript.uncopied'));
    setTimeout(() => this.words.write(told, ''), TOLD);
  }
}
