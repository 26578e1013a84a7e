import type { PageWords } from '../words/page-words.ts';
import { say, type Sentence } from '../words/text.ts';
import type { Finding } from './finding.ts';

const MARKS = { good: '✓', fair: '!', bad: '✗', none: '–' } as const;

/** One line of the page: what is checked, what was found, and what a visitor can do. */
export class Line {
  /** What the visitor may press or see. */
  readonly acts = make('div', 'acts');
  private readonly page: PageWords;
  private readonly item = document.createElement('li');
  private readonly mark = make('span', 'mark', '…');
  private readonly words = make('p', 'words');
  private readonly advice = make('p', 'advice');

  constructor(list: HTMLElement, page: PageWords, id: string, title: Sentence) {
    this.page = page;
    const text = document.createElement('div');
    const heading = make('h2', '');
    page.write(heading, title);
    text.append(heading, this.words, this.advice, this.acts);
    this.item.id = id;
    this.item.append(this.mark, text);
    this.words.role = 'status';
    list.append(this.item);
  }

  show({ verdict, words, advice }: Finding): void {
    this.item.dataset.verdict = verdict;
    this.mark.textContent = MARKS[verdict];
    this.mark.role = 'img';
    this.page.write(this.mark, say(`check.${verdict}`), 'label');
    this.page.write(this.words, words);
    this.page.write(this.advice, advice ?? '');
  }

  /** Shows a sentence while nothing has been found. */
  ask(words: Sentence): void {
    delete this.item.dataset.verdict;
    this.mark.textContent = '?';
    this.page.write(this.words, words);
    this.page.write(this.advice, '');
  }

  /** A button below the sentence. */
  button(label: Sentence, act: () => void): HTMLButtonElement {
    const button = make('button', '');
    this.page.write(button, label);
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
