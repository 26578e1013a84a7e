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

  /** Address of a file of the bundle. */
  file(name: string): string {
    return this.address(`bundle/${name}`).href;
  }

  /** Address of the server's WebSocket. */
  socket(): string {
    const url = this.address('ws');
    url.protocol = url.protocol === 'https:' ? 'wss:' : 'ws:';
    return url.href;
  }

  private address(path: string): URL {
    const url = new URL(path, this.base);
    if (this.token) url.searchParams.set('token', this.token);
    return url;
  }
}
