import { createServer, connect, type AddressInfo, type Server, type Socket } from 'node:net';

const PIECE = 4096; // bytes that cross the line at once

/**
 * A line of some bits per second between pages and a server, which all connections share.
 *
 * Chromium can slow a page's network down by itself, but then one page in two hundred waits for ever:
 * answers lie in its sockets, and it does not read them.
 */
export class SlowLine {
  private readonly server: Server;
  private readonly sockets = new Set<Socket>();
  /** The server's page behind the line. */
  readonly url: string;

  private constructor(server: Server, url: string) {
    this.server = server;
    this.url = url;
  }

  /**
   * @param server URL of a server on this machine
   * @param bitsPerSecond in each direction
   * @param latency ms, there and back
   */
  static async to(server: string, bitsPerSecond: number, latency: number): Promise<SlowLine> {
    const url = new URL(server);
    const port = Number(url.port);
    const [up, down] = [new Way(bitsPerSecond, latency / 2), new Way(bitsPerSecond, latency / 2)];
    const listener = createServer((near) => {
      const far = connect(port, '127.0.0.1');
      for (const socket of [near, far]) {
        line.sockets.add(socket);
        socket.on('close', () => line.sockets.delete(socket)).on('error', () => {});
      }
      void up.carry(near, far);
      void down.carry(far, near);
    });
    await new Promise<void>((resolve) => listener.listen(0, '127.0.0.1', resolve));
    url.port = String((listener.address() as AddressInfo).port);
    const line = new SlowLine(listener, url.href);
    return line;
  }

  close(): void {
    this.server.close();
    for (const socket of this.sockets) socket.destroy();
  }
}

/** One direction of a line. */
class Way {
  private readonly bytesPerMs: number;
  private readonly delay: number;
  private free = 0; // ms on the clock: when the next byte may leave

  constructor(bitsPerSecond: number, delay: number) {
    this.bytesPerMs = bitsPerSecond / 8000;
    this.delay = delay;
  }

  /** Carries all that one socket receives to another one, until either ends. */
  async carry(from: Socket, to: Socket): Promise<void> {
    let arrived = Promise.resolve();
    try {
      for await (const bytes of from as AsyncIterable<Buffer>) {
        for (let at = 0; at < bytes.length; at += PIECE) {
          const piece = bytes.subarray(at, at + PIECE);
          this.free = Math.max(this.free, performance.now()) + piece.length / this.bytesPerMs;
          const due = this.free + this.delay;
          arrived = arrived.then(() => until(due)).then(() => void (to.writable && to.write(piece)));
          await until(this.free);
        }
      }
    } catch {
      // the connection was given up
    }
    await arrived;
    to.end();
  }
}

async function until(time: number): Promise<void> {
  const left = time - performance.now();
  if (left > 0) await new Promise((resolve) => setTimeout(resolve, left));
}
