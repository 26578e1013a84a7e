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

  /** Address of the server's WebSocket. */
  socket(): string {
    const url = new URL('ws', this.base);
    url.protocol = this.base.protocol === 'https:' ? 'wss:' : 'ws:';
    url.search = url.hash = '';
    return url.href;
  }
}
