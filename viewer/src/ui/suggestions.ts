import { byId } from './elements.ts';

/** The text box proposes questions to a visitor who does not know what to say, and completes what is typed to them. */
export function suggest(root: ParentNode, questions: readonly string[]): void {
  const options = questions.map((question) => {
    const option = document.createElement('option');
    option.value = question.replace(/^./u, (letter) => letter.toUpperCase()); // notes begin in any way
    return option;
  });
  byId(root, 'suggestions').replaceChildren(...options);
}
