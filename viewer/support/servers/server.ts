import { execFileSync, spawn, type ChildProcess } from 'node:child_process';
import { once } from 'node:events';
import { PATIENCE } from '../patience.ts';
import { ENVIRONMENT, PYTHON, REPOSITORY } from '../python.ts';

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
    return ChatServer.run(['serve', bundle, '--port', String(port), ...more]);
  }

  /** @param folder where the recordings are */
  static studio(folder: string): Promise<ChatServer> {
    return ChatServer.run(['studio', folder, '--port', '0', '--no-browser']);
  }

  /** `ico3d studio` with a folder, which tracks faces by the models in another one, with more arguments. */
  static tracking(folder: string, models: string, ...more: string[]): Promise<ChatServer> {
    return ChatServer.run(['studio', folder, '--port', '0', '--no-browser', ...more], { ...ENVIRONMENT, ICO3D_MODELS: models });
  }

  private static async run(words: string[], env: NodeJS.ProcessEnv = ENVIRONMENT): Promise<ChatServer> {
    const child = spawn(PYTHON, ['-m', 'ico3d.cli', ...words], { cwd: REPOSITORY, env, stdio: ['ignore', 'pipe', 'inherit'] });
    return new ChatServer(child, await readUrl(child));
  }

  /** From now on the system lets its files grow to so many bytes, as on a full disk. */
  limit(bytes: number | 'unlimited'): void {
    execFileSync('prlimit', ['--pid', String(this.child.pid), `--fsize=${bytes}:`]); // the soft limit, which can be lifted
  }

  /** Ends it without a word, as the system does that has no memory left. */
  kill(): Promise<void> {
    return this.stop('SIGKILL');
  }

  async stop(signal: NodeJS.Signals = 'SIGINT'): Promise<void> {
    this.child.kill(signal);
    if (this.child.exitCode === null && this.child.signalCode === null) await once(this.child, 'exit');
  }
}

function readUrl(child: ChildProcess): Promise<string> {
  return new Promise((resolve, reject) => {
    let printed = '';
    const timer = setTimeout(() => reject(new Error(`ico3d serve does not start: ${printed}`)), PATIENCE);
    child.stdout!.on('data', (chunk: Buffer) => {
      printed += chunk.toString();
      const url = /https?:\/\/\S+\//.exec(printed)?.[0];
      if (!url) return;
      clearTimeout(timer);
      resolve(url);
    });
    child.on('exit', (code) => reject(new Error(`ico3d serve ended with status ${code}: ${printed}`)));
  });
}
