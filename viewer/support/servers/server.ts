import { spawn, type ChildProcess } from 'node:child_process';
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

  /** @param folder where the recordings are @param more arguments of `ico3d studio` */
  static studio(folder: string, port = 0, ...more: string[]): Promise<ChatServer> {
    return ChatServer.run(['studio', folder, '--port', String(port), '--no-browser', ...more]);
  }

  /** `ico3d studio` with a folder, which tracks faces by the models in another one. */
  static tracking(folder: string, models: string): Promise<ChatServer> {
    return ChatServer.run(['studio', folder, '--port', '0', '--no-browser'], [], { ...ENVIRONMENT, ICO3D_MODELS: models });
  }

  /** `ico3d studio` with a folder, whose files the system lets grow to so many bytes, as on a full disk. */
  static limited(folder: string, bytes: number): Promise<ChatServer> {
    return ChatServer.run(['studio', folder, '--port', '0', '--no-browser'], ['prlimit', `--fsize=${bytes}`]);
  }

  private static async run(words: string[], before: string[] = [], env: NodeJS.ProcessEnv = ENVIRONMENT): Promise<ChatServer> {
    const [program, ...args] = [...before, PYTHON, '-m', 'ico3d.cli', ...words];
    const child = spawn(program!, args, { cwd: REPOSITORY, env, stdio: ['ignore', 'pipe', 'inherit'] });
    return new ChatServer(child, await readUrl(child));
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
