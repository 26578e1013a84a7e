/** The element with an id under a root; the page is wrong if there is none. */
export function byId<T extends HTMLElement>(root: ParentNode, id: string): T {
  const element = root.querySelector<T>(`#${id}`);
  if (!element) throw new Error(`the page has no #${id}`);
  return element;
}
