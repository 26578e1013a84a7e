/** Moves the focus to an element, unless the visitor is elsewhere: at the page around an embedded avatar. */
export function focusOn(element: HTMLElement): void {
  const tree = element.getRootNode() as Document | ShadowRoot;
  if (tree.activeElement) element.focus({ preventScroll: true });
}

/** The element with an id under a root; the page is wrong if there is none. */
export function byId<T extends HTMLElement>(root: ParentNode, id: string): T {
  const element = root.querySelector<T>(`#${id}`);
  if (!element) throw new Error(`the page has no #${id}`);
  return element;
}
