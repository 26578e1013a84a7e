/** The value behind the `#` of a talk's address that says which page of the studio opened it. */
const NAME = 'studio';
const PAGE = /^\/(?:[\w.~-]+\/)*studio$/; // where a server has the page

/** Where a page is. */
export type Here = Pick<URL, 'protocol' | 'hostname'>;

/**
 * Lets a talk's page lead back to the page of the studio that opens it.
 *
 * The studio's key does not come along: whoever is shown the address of the talk must not get it.
 *
 * @param talk address of the talk's page, which is changed
 * @param studio address of the studio's page
 */
export function leadBack(talk: URL, studio: URL): void {
  const way = wayTo(studio, talk);
  if (way === null) return;
  const values = new URLSearchParams(talk.hash.slice(1));
  values.set(NAME, way);
  talk.hash = values.toString();
}

/**
 * The address of the studio's page that opened a talk; null if there is none.
 *
 * Anybody can write the address of a talk, so that it may lead nowhere but to a studio on the same host.
 *
 * @param hash what stands behind the `#` of the talk's address, with it
 * @param here where the talk's page is
 */
export function wayBack(hash: string, here: Here): string | null {
  const value = new URLSearchParams(hash.slice(1)).get(NAME);
  return value !== null && URL.canParse(value) ? wayTo(new URL(value), here) : null;
}

/** Shows the links that lead back to the studio, if it opened the page. */
export function showWayBack(root: ParentNode, hash: string, here: Here): void {
  const way = wayBack(hash, here);
  if (way === null) return;
  for (const link of root.querySelectorAll<HTMLAnchorElement>('a.way-back')) {
    link.href = way;
    link.hidden = false;
  }
}

/** Address of a studio's page with the person who is open there, and nothing else; null if it is none beside `here`. */
function wayTo(studio: URL, here: Here): string | null {
  const isWeb = here.protocol === 'http:' || here.protocol === 'https:';
  const isBeside = isWeb && studio.protocol === here.protocol && studio.hostname === here.hostname;
  if (!isBeside || studio.username || studio.password || !PAGE.test(studio.pathname)) return null;
  const person = new URLSearchParams(studio.hash.slice(1)).get('of');
  const hash = person === null ? '' : `#${new URLSearchParams({ of: person })}`;
  return `${studio.protocol}//${studio.host}${studio.pathname}${hash}`;
}
