import { every } from '../lifetime.ts';
import { LATENCY_PARTS } from '../shared.ts';
import { Latencies } from '../talk/latency.ts';
import type { Figures } from '../stage/figures.ts';
import { makeDisclosure } from './disclosure.ts';
import { byId } from './elements.ts';

const PERIOD = 1000; // ms between updates

const NAMES: Record<(typeof LATENCY_PARTS)[number], string> = {
  vad: 'notice silence',
  turn: 'end of turn',
  token: 'first word',
  clause: 'first clause',
  voice: 'first sound',
  expression: 'first face',
  send: 'send',
};

/** The small panel with figures: frame rate, latency and its parts. */
export class Panel {
  private readonly rows = new Map<string, HTMLElement>();
  private readonly list: HTMLElement;
  private readonly table: HTMLTableElement;
  private readonly latencies = new Latencies();
  private frames = 0;

  /** @param figures what drawing takes now */
  constructor(root: ParentNode, figures: () => Figures, signal: AbortSignal) {
    this.list = byId(root, 'figures');
    this.table = byId(root, 'latencies');
    makeDisclosure(byId(root, 'panel-button'), byId(root, 'panel'));
    every(PERIOD, signal, () => this.figures(figures()));
  }

  private figures(now: Figures): void {
    this.set('frames', `${now.frames - this.frames} /s`);
    this.frames = now.frames;
    this.set('evaluate', `${now.evaluation.toFixed(1)} ms`);
    this.set('draw', `${now.draw.toFixed(1)} ms`);
    this.set('sort', `${now.sort.toFixed(0)} ms`);
    this.set('Gaussians', now.gaussians.toLocaleString('en'));
    this.set('pixels', now.pixels.join(' × '));
    this.set('quality', `${now.levels - now.level + 1} of ${now.levels}`);
    this.set('to first sight', `${(now.bytes / 1e6).toFixed(1)} MB`);
  }

  /** Shows the time from the end of the question to the first sound of the answer. */
  latency(milliseconds: number): void {
    this.latencies.add('heard', milliseconds);
    this.set('question to answer', `${Math.round(milliseconds)} ms`);
    this.draw();
  }

  metrics(name: string, values: Record<string, number>): void {
    if (name !== 'turn') return; // when it was heard the page knows better
    for (const [part, value] of Object.entries(values)) this.latencies.add(part, value);
    this.draw();
  }

  /** One row for each part of the latency; a bar shows which share of the whole it takes by its median, and after which parts. */
  private draw(): void {
    const parts = LATENCY_PARTS.map((part) => ({ name: NAMES[part], spread: this.latencies.spread(part) }));
    const heard = this.latencies.spread('heard');
    const whole = Math.max(heard?.p50 ?? 0, parts.reduce((sum, { spread }) => sum + (spread?.p50 ?? 0), 0), 1);
    let start = 0;
    const rows = parts.flatMap(({ name, spread }) => {
      if (!spread) return [];
      const row = makeRow(name, spread.p50, spread.p95, start / whole, spread.p50 / whole);
      start += spread.p50;
      return [row];
    });
    if (heard) rows.push(makeRow('heard', heard.p50, heard.p95, 0, heard.p50 / whole));
    this.table.tBodies[0]!.replaceChildren(...rows);
    this.table.hidden = rows.length === 0;
  }

  private set(name: string, value: string): void {
    let cell = this.rows.get(name);
    if (!cell) {
      const term = document.createElement('dt');
      term.textContent = name;
      cell = document.createElement('dd');
      this.list.append(term, cell);
      this.rows.set(name, cell);
    }
    cell.textContent = value;
  }
}

/**
 * A row of the table.
 *
 * @param from where its bar begins, of the table's width
 * @param share the bar's length, of the table's width
 */
function makeRow(name: string, p50: number, p95: number, from: number, share: number): HTMLTableRowElement {
  const row = document.createElement('tr');
  const head = document.createElement('th');
  head.scope = 'row';
  head.textContent = name;
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
