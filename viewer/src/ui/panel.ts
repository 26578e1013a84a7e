import { byId } from './elements.ts';

const PERIOD = 1000; // ms between updates

/** The small panel with figures: frame rate, latency and its parts. */
export class Panel {
  private readonly rows = new Map<string, HTMLElement>();
  private readonly list = byId('figures');
  private lastFrames = 0;

  /** @param frames frames drawn so far */
  constructor(frames: () => number) {
    const button = byId<HTMLButtonElement>('panel-button');
    const panel = byId('panel');
    button.onclick = () => {
      panel.hidden = !panel.hidden;
      button.setAttribute('aria-expanded', String(!panel.hidden));
    };
    setInterval(() => {
      this.set('frames', `${frames() - this.lastFrames} /s`);
      this.lastFrames = frames();
    }, PERIOD);
  }

  /** Shows the time from the end of the question to the first sound of the answer. */
  latency(milliseconds: number): void {
    this.set('question to answer', `${Math.round(milliseconds)} ms`);
  }

  metrics(name: string, values: Record<string, number>): void {
    for (const [part, value] of Object.entries(values)) {
      this.set(part === 'total' ? name : `${name}: ${part}`, `${Math.round(value)} ms`);
    }
  }

  private set(name: string, value: string): void {
    let cell = this.rows.get(name);
    if (!cell) {
      const term = document.createElement('dt');
      term.textContent = name.replaceAll('_', ' ');
      cell = document.createElement('dd');
      this.list.append(term, cell);
      this.rows.set(name, cell);
    }
    cell.textContent = value;
  }
}
