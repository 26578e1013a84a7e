/** What the visitor chose; null where they did not, or the browser keeps nothing. */
export function remembered(key: string): string | null {
  return reach((storage) => storage.getItem(nameOf(key)), lasting);
}

/** Keeps a choice for the next visit, where the browser lets this page; else it holds until the page is left. */
export function remember(key: string, value: string): void {
  reach((storage) => storage.setItem(nameOf(key), value), lasting);
}

/** Keeps nothing under a name any more. */
export function forget(key: string): void {
  reach((storage) => storage.removeItem(nameOf(key)), lasting);
}

/** What was kept until the tab is closed; null where nothing was, or the browser keeps nothing. */
export function rememberedInTab(key: string): string | null {
  return reach((storage) => storage.getItem(nameOf(key)), ofTab);
}

/** Keeps something until the tab is closed, for this site alone, where the browser lets this page. */
export function rememberInTab(key: string, value: string): void {
  reach((storage) => storage.setItem(nameOf(key), value), ofTab);
}

/** Keeps nothing under a name any more until the tab is closed. */
export function forgetInTab(key: string): void {
  reach((storage) => storage.removeItem(nameOf(key)), ofTab);
}

function nameOf(key: string): string {
  return `ico3d-${key}`;
}

const lasting = () => localStorage;
const ofTab = () => sessionStorage;

/** Reads or writes where things are kept; null where the browser keeps nothing, which may show already in the asking. */
function reach<T>(act: (storage: Storage) => T, storage: () => Storage): T | null {
  try {
    return act(storage());
  } catch {
    return null;
  }
}
