import type { Finding } from './finding.ts';

const MARKS: Record<Finding['verdict'], [sign: string, word: string]> = {
  good: ['✓', 'Good'],
  fair: ['!', 'Could be better'],
  bad: ['✗', 'Does not work'],
  none: ['–', 'Not there'],
};

/** One line of the page: what is checked, what was found, and what a visitor can do. */
export class Line {
  /** What the visitor may press or see. */
  readonly acts = make('div', 'acts');
  private readonly item = document.createElement('li');
  private readonly mark = make('span', 'mark', '…');
  private readonly words = make('p', 'words');
  private readonly advice = make('p', 'advice');

  constructor(list: HTMLElement, id: string, title: string) {
    const text = document.createElement('div');
    text.append(make('h3', '', title), this.words, this.advice, this.acts);
    this.item.id = id;
    this.item.append(this.mark, text);
    this.words.role = 'status';
    list.append(this.item);
  }

  show({ verdict, words, advice }: Finding): void {
    const [sign, word] = MARKS[verdict];
    this.item.dataset.verdict = verdict;
    this.mark.textContent = sign;
    this.mark.role = 'img';
    this.mark.ariaLabel = word;
    this.words.textContent = words;
    this.advice.textContent = advice ?? '';
  }

  /** Shows a sentence while nothing has been found. */
  ask(words: string): void {
    delete this.item.dataset.verdict;
    this.mark.textContent = '?';
    this.words.textContent = words;
    this.advice.textContent = '';
  }

  /** A button below the sentence. */
  button(label: string, act: () => void): HTMLButtonElement {
    const button = make('button', '', label);
    button.onclick = act;
    this.acts.append(button);
    return button;
  }
}

function make<Tag extends keyof HTMLElementTagNameMap>(tag: Tag, className: string, text = ''): HTMLElementTagNameMap[Tag] {
  const element = document.createElement(tag);
  element.className = className;
  element.textContent = text;
  return element;
}
