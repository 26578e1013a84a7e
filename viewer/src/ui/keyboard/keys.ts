/** Whether a key is typed into a text, or is meant for the browser. */
export function isForOthers(event: KeyboardEvent): boolean {
  if (event.ctrlKey || event.metaKey || event.altKey) return true;
  const target = event.composedPath()[0] as Element;
  return target.closest?.('textarea, select, [contenteditable], input:not([type=radio], [type=range], [type=checkbox])') != null;
}
