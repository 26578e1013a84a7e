import type { Generator } from './gaussians/generator.ts';
import './style.css';
import { Server } from './server.ts';
import { readSplats, type Splats } from './stage/webgl/readback.ts';
import { KeptTalk } from './ui/sheets/kept-talk.ts';
import { showWayBack } from './ui/way-back.ts';
import { Visit, type Presence } from './visit.ts';
import { PageWords } from './words/page-words.ts';
import { xrSettings } from './xr/settings.ts';

declare global {
  interface Window {
    /** For tests and for the curious: what the page is made of. */
    ico3d?: Presence & {
      visit: Visit;
      splats: (generator: Generator) => Splats;
    };
  }
}

const secrets = new URLSearchParams(location.hash.slice(1)); // what browsers send nowhere
const parameters = new URL(location.href).searchParams;
const visit: Visit = new Visit(document.body, new Server(new URL(location.href)), {
  draw: parameters.get('draw'),
  xr: xrSettings((name) => parameters.get(name)),
  words: new PageWords(document.documentElement),
  emit: () => {},
  named: (name) => (document.title = name),
  entered: (presence) => {
    window.ico3d = { ...presence, visit, splats: (generator) => readSplats(presence.stage, generator) };
    const seconds = parameters.get('bench');
    if (seconds !== null) void import('./bench.ts').then(({ bench }) => bench(presence, Number(seconds) || undefined));
  },
  reload: () => location.reload(),
  keeps: (home, avatar) => new KeptTalk(home, avatar), // a reload does not lose it
  key: secrets.get('key'),
  unlock: (key) => {
    secrets.set('key', key);
    location.hash = secrets.toString();
    location.reload();
  },
});

showWayBack(document, location.hash, location);
addEventListener('pagehide', ({ persisted }) => persisted || visit.dispose());
