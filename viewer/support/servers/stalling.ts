import { spawn, type ChildProcess } from 'node:child_process';
import { once } from 'node:events';
import { PYTHON, REPOSITORY } from '../python.ts';

/** A network between a page and its server that can be made to stall. */
export class StallingLine {
  private readonly child: ChildProcess;
  /** The server's page behind the line. */
  readonly url: string;

  private constructor(child: ChildProcess, url: string) {
    this.child = child;
    this.url = url;
  }

  /** @param server URL of a server on this machine */
  static async to(server: string): Promise<StallingLine> {
    const url = new URL(server);
    const script = `${REPOSITORY}viewer/support/servers/stalling_proxy.py`;
    const child = spawn(PYTHON, [script, url.port], { stdio: ['pipe', 'pipe', 'inherit'] });
    const [printed] = (await once(child.stdout!, 'data')) as [Buffer];
    url.port = printed.toString().trim();
    return new StallingLine(child, url.href);
  }

  /** From now on nothing gets through, in either direction. */
  stall(): void {
    this.child.stdin!.write('stall\n');
  }

  /** Everything that waited gets through. */
  flow(): void {
    this.child.stdin!.write('flow\n');
  }

  async stop(): Promise<void> {
    this.child.stdin!.end();
    if (this.child.exitCode === null) await once(this.child, 'exit');
  }
}
