import { createReadStream, existsSync } from 'node:fs';
import { createServer, type Server } from 'node:http';
import type { AddressInfo } from 'node:net';
import { extname, join } from 'node:path';
import type { Duplex } from 'node:stream';
import { REPOSITORY } from '../python.ts';

const BUILD = join(REPOSITORY, 'src/ico3d/chat/static');
const TYPES: Record<string, string> = {
  '.html': 'text/html',
  '.js': 'text/javascript',
  '.css': 'text/css',
  '.json': 'application/json',
  '.png': 'image/png',
};

/** Serves the built page with a bundle's folder; a conversation is always about to begin. */
export async function servePage(bundle: string): Promise<{ url: string; close: () => void }> {
  const server: Server = createServer((request, response) => {
    const { pathname } = new URL(request.url!, 'http://localhost');
    const file = pathname.startsWith('/bundle/')
      ? join(bundle, pathname.slice('/bundle/'.length))
      : join(BUILD, pathname === '/' ? 'index.html' : pathname);
    if (!existsSync(file)) {
      response.writeHead(404).end();
      return;
    }
    response.writeHead(200, { 'content-type': TYPES[extname(file)] ?? 'application/octet-stream' });
    createReadStream(file).pipe(response);
  });
  const lines: Duplex[] = []; // never answered: a page that hears of none gives up after a while
  server.on('upgrade', (_, line) => lines.push(line));
  await new Promise<void>((resolve) => server.listen(0, '127.0.0.1', resolve));
  const { port } = server.address() as AddressInfo;
  const close = () => {
    server.close();
    for (const line of lines) line.destroy();
  };
  return { url: `http://127.0.0.1:${port}/`, close };
}
