/** Where an avatar comes from: the addresses of what its server has. */
export class Server {
  /** Admits to servers that ask for it; empty for none. */
  token: string;
  private readonly base: URL;

  /** @param base address of the server's page; it may hold a token */
  constructor(base: URL) {
    this.base = base;
    this.token = base.searchParams.get('token') ?? '';
  }

  /**
   * Address of a file of the bundle.
   *
   * @param sha256 names the content, which browsers may then keep for ever
   */
  file(name: string, sha256?: string): string {
    const url = this.address(`bundle/${name}`);
    if (sha256) url.searchParams.set('sha256', sha256);
    return url.href;
  }

  /** Address that gives tokens to those who have the key. */
  tokens(): string {
    return new URL('token', this.base).href;
  }

  /** Address by which a browser tells this server from others; without what admits to it. */
  home(): string {
    return this.base.origin + this.base.pathname;
  }

  /** Address of the page that checks the visitor's device. */
  check(): string {
    return new URL('check', this.base).href;
  }

  /**
   * Address below the recordings of a studio page's server.
   *
   * @param path names, each of them encoded
   */
  recordings(path: string, values: Record<string, string> = {}): string {
    const url = this.address(`recordings/${path}`);
    for (const [name, value] of Object.entries(values)) url.searchParams.set(name, value);
    return url.href;
  }

  /** Address of the server's WebSocket. */
  socket(): string {
    return this.webSocket('ws');
  }

  /** Address of a WebSocket that returns what it gets. */
  echo(): string {
    return this.webSocket('echo');
  }

  private webSocket(path: string): string {
    const url = this.address(path);
    url.protocol = url.protocol === 'https:' ? 'wss:' : 'ws:';
    return url.href;
  }

  private address(path: string): URL {
    const url = new URL(path, this.base);
    if (this.token) url.searchParams.set('token', this.token);
    return url;
  }
}
