/** A sentence of a list. */
export function item(text: string): HTMLLIElement {
  const row = document.createElement('li');
  row.textContent = text;
  return row;
}
