/** Where an avatar comes from: the addresses of what its server has. */
export class Server {
  private readonly base: URL;

  /** @param base address of the server's page */
  constructor(base: URL) {
    this.base = base;
  }

  /** Address of a file of the bundle. */
  file(name: string): string {
    return new URL(`bundle/${name}`, this.base).href;
  }

  /** Address of the page that checks the visitor's device. */
  check(): string {
    return new URL('check', this.base).href;
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
    const url = new URL(path, this.base);
    url.protocol = this.base.protocol === 'https:' ? 'wss:' : 'ws:';
    url.search = url.hash = '';
    return url.href;
  }
}
