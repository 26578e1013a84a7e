/** What the visitor chose; null where they did not, or the browser keeps nothing. */
export function remembered(key: string): string | null {
  try {
    return localStorage.getItem(`ico3d-${key}`);
  } catch {
    return null;
  }
}

/** Keeps a choice for the next visit, where the browser lets this page. */
export function remember(key: string, value: string): void {
  try {
    localStorage.setItem(`ico3d-${key}`, value);
  } catch {
    // It holds until the page is left.
  }
}

/** Keeps nothing under a name any more. */
export function forget(key: string): void {
  try {
    localStorage.removeItem(`ico3d-${key}`);
  } catch {
    // Where nothing is kept there is nothing to forget.
  }
}

/** What was kept until the tab is closed; null where nothing was, or the browser keeps nothing. */
export function rememberedInTab(key: string): string | null {
  try {
    return sessionStorage.getItem(`ico3d-${key}`);
  } catch {
    return null;
  }
}

/** Keeps something until the tab is closed, for this site alone, where the browser lets this page. */
export function rememberInTab(key: string, value: string): void {
  try {
    sessionStorage.setItem(`ico3d-${key}`, value);
  } catch {
    // It holds until the page is left.
  }
}
