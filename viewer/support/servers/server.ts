import { execFileSync, spawn, type ChildProcess } from 'node:child_process';
import { once } from 'node:events';
import { ENVIRONMENT, forkServer, PYTHON, REPOSITORY } from '../python.ts';

/** `ico3d serve` with a bundle, or `ico3d studio` with a folder, on a free port of this machine. */
export class ChatServer {
  private readonly child: ChildProcess;
  readonly url: string;

  private constructor(child: ChildProcess, url: string) {
    this.child = child;
    this.url = url;
  }

  /** @param more arguments of `ico3d serve` */
  static start(bundle: string, port = 0, ...more: string[]): Promise<ChatServer> {
    return ChatServer.of(forkServer(bundle, '--port', String(port), ...more));
  }

  /** @param folder where the recordings are */
  static studio(folder: string): Promise<ChatServer> {
    return ChatServer.run(['studio', folder, '--port', '0', '--no-browser']);
  }

  /** `ico3d studio` with a folder, which tracks faces by the models in another one, with more arguments. */
  static tracking(folder: string, models: string, ...more: string[]): Promise<ChatServer> {
    return ChatServer.run(['studio', folder, '--port', '0', '--no-browser', ...more], { ...ENVIRONMENT, ICO3D_MODELS: models });
  }

  private static run(words: string[], env: NodeJS.ProcessEnv = ENVIRONMENT): Promise<ChatServer> {
    return ChatServer.of(spawn(PYTHON, ['-m', 'ico3d.cli', ...words], { cwd: REPOSITORY, env, stdio: ['ignore', 'pipe', 'inherit'] }));
  }

  private static async of(child: ChildProcess): Promise<ChatServer> {
    return new ChatServer(child, await readUrl(child));
  }

  /** From now on the system lets its files grow to so many bytes, as on a full disk. */
  limit(bytes: number | 'unlimited'): void {
    execFileSync('prlimit', ['--pid', String(this.child.pid), `--fsize=${bytes}:`]); // the soft limit, which can be lifted
  }

  /** Ends it without a word, as the system does that has no memory left. */
  kill(): Promise<void> {
    return this.stop('SIGUSR1');
  }

  async stop(signal: NodeJS.Signals = 'SIGINT'): Promise<void> {
    this.child.kill(signal);
    if (this.child.exitCode === null && this.child.signalCode === null) await once(this.child, 'exit');
  }
}

/** The address that a server prints; a busy machine takes its time until then. */
function readUrl(child: ChildProcess): Promise<string> {
  return new Promise((resolve, reject) => {
    let printed = '';
    child.stdout!.on('data', (chunk: Buffer) => {
      printed += chunk.toString();
      const url = /https?:\/\/\S+\//.exec(printed)?.[0];
      if (url) resolve(url);
    });
    child.on('exit', (code) => reject(new Error(`ico3d serve ended with status ${code}: ${printed}`)));
  });
}
