import { every } from '../../lifetime.ts';
import { LATENCY_PARTS } from '../../shared.ts';
import { Latencies } from '../../talk/latency.ts';
import type { Figures } from '../../stage/figures.ts';
import type { PageWords } from '../../words/page-words.ts';
import { say, type Key, type Message } from '../../words/text.ts';
import { Disclosure } from './disclosure.ts';
import { byId } from '../elements.ts';
import { icon } from '../icons.ts';

/** What a name alone does not tell. */
const ABOUT: Partial<Record<Key, Key>> = {
  'figure.evaluate': 'figure.evaluate.about',
  'figure.draw': 'figure.draw.about',
  'figure.quality': 'figure.quality.about',
};
const PERIOD = 1000; // ms between updates

/** The small panel with figures: frame rate, latency and its parts. */
export class Panel {
  private readonly words: PageWords;
  private readonly rows = new Map<Key, HTMLElement>();
  private readonly list: HTMLElement;
  private readonly table: HTMLTableElement;
  private readonly latencies = new Latencies();
  private frames = 0;

  /** @param figures what drawing takes now */
  constructor(root: HTMLElement, words: PageWords, figures: () => Figures, signal: AbortSignal) {
    this.words = words;
    this.list = byId(root, 'figures');
    this.table = byId(root, 'latencies');
    byId(root, 'panel-button').append(icon('chart'));
    new Disclosure(root, 'panel', signal);
    every(PERIOD, signal, () => this.figures(figures()));
  }

  private figures(now: Figures): void {
    this.set('figure.frames', `${now.frames - this.frames} /s`);
    this.frames = now.frames;
    this.set('figure.evaluate', `${this.number(now.evaluation, 1)} ms`);
    this.set('figure.draw', `${this.number(now.draw, 1)} ms`);
    this.set('figure.sort', `${this.number(now.sort, 0)} ms`);
    this.set('figure.gaussians', this.number(now.gaussians, 0));
    this.set('figure.drawn', now.drawn);
    this.set('figure.pixels', now.pixels.join(' × '));
    this.set('figure.quality', say('figure.level', { level: now.levels - now.level + 1, levels: now.levels }));
    this.set('figure.bytes', `${this.number(now.bytes / 1e6, 1)} MB`);
  }

  /** Shows the time from the end of the question to the first sound of the answer. */
  latency(milliseconds: number): void {
    this.latencies.add('heard', milliseconds);
    this.set('figure.latency', `${Math.round(milliseconds)} ms`);
    this.draw();
  }

  metrics(name: string, values: Record<string, number>): void {
    if (name !== 'turn') return; // when it was heard the page knows better
    for (const [part, value] of Object.entries(values)) this.latencies.add(part, value);
    this.draw();
  }

  /** One row for each part of the latency; a bar shows which share of the whole it takes by its median, and after which parts. */
  private draw(): void {
    const parts = LATENCY_PARTS.map((part) => ({ name: say(`part.${part}`), spread: this.latencies.spread(part) }));
    const heard = this.latencies.spread('heard');
    const whole = Math.max(heard?.p50 ?? 0, parts.reduce((sum, { spread }) => sum + (spread?.p50 ?? 0), 0), 1);
    let start = 0;
    const rows = parts.flatMap(({ name, spread }) => {
      if (!spread) return [];
      const row = this.row(name, spread.p50, spread.p95, start / whole, spread.p50 / whole);
      start += spread.p50;
      return [row];
    });
    if (heard) rows.push(this.row(say('part.heard'), heard.p50, heard.p95, 0, heard.p50 / whole));
    this.table.tBodies[0]!.replaceChildren(...rows);
    this.table.hidden = rows.length === 0;
  }

  private set(name: Key, value: Message | string): void {
    let cell = this.rows.get(name);
    if (!cell) {
      const term = document.createElement('dt');
      term.append(this.worded('span', name));
      if (ABOUT[name]) term.append(this.worded('small', ABOUT[name]));
      cell = document.createElement('dd');
      const row = document.createElement('div');
      row.append(term, cell);
      this.list.append(row);
      this.rows.set(name, cell);
    }
    this.words.write(cell, value);
  }

  /**
   * A row of the table.
   *
   * @param from where its bar begins, of the table's width
   * @param share the bar's length, of the table's width
   */
  private row(name: Message, p50: number, p95: number, from: number, share: number): HTMLTableRowElement {
    const row = document.createElement('tr');
    const head = document.createElement('th');
    head.scope = 'row';
    this.words.write(head, name);
    const bar = document.createElement('td');
    bar.className = 'bar';
    const fill = document.createElement('span');
    fill.style.marginInlineStart = `${Math.min(100, 100 * from).toFixed(1)}%`;
    fill.style.width = `${Math.min(100 - 100 * from, 100 * share).toFixed(1)}%`;
    bar.append(fill);
    const figures = [p50, p95].map((value) => {
      const cell = document.createElement('td');
      cell.textContent = String(Math.round(value));
      return cell;
    });
    row.append(head, bar, ...figures);
    return row;
  }

  private worded(tag: 'span' | 'small', key: Key): HTMLElement {
    const element = document.createElement(tag);
    this.words.write(element, say(key));
    return element;
  }

  private number(value: number, digits: number): string {
    return value.toLocaleString(this.words.language, { minimumFractionDigits: digits, maximumFractionDigits: digits });
  }
}
