/** Where in the studio the page is: its address says it, so that a reload and the browser's Back lead there again. */
export class Place {
  /** Whose recording is open; null on the first page. */
  get person(): string | null {
    return this.read().get('of');
  }

  /** The chosen part of it. */
  get part(): string | null {
    return this.read().get('part');
  }

  /** Somebody's recording is open now, or nobody's: Back leads to what was open before. */
  open(person: string | null): void {
    if (person === this.person) return;
    const values = this.read();
    values.delete('part');
    if (person === null) values.delete('of');
    else values.set('of', person);
    history.pushState(null, '', addressOf(values));
  }

  /** Another part is chosen; Back does not go through parts. */
  choose(part: string): void {
    if (part === this.part) return;
    const values = this.read();
    values.set('part', part);
    history.replaceState(null, '', addressOf(values));
  }

  /** What stands behind the `#`, where the key that admits may stand, too: browsers send none of it. */
  private read(): URLSearchParams {
    return new URLSearchParams(location.hash.slice(1));
  }
}

function addressOf(values: URLSearchParams): string {
  const hash = values.size > 0 ? `#${values}` : '';
  return location.pathname + location.search + hash;
}
