import type { Object3D } from 'three';
import { timePictures, type Timing } from './stage/timing.ts';
import type { Presence } from './visit.ts';

const SECONDS = 4;
const SQUARE = 512; // pixels along a side

/** A row of the table. */
interface Row extends Timing {
  part: string;
  width: number; // pixels
  height: number;
}

/**
 * What pictures of the backdrop, the body, the head and all of them take, of 512² pixels and as large
 * as the window's.
 *
 * @param seconds that each row may take
 */
async function measure({ stage, head, body, skinned, backdrop }: Presence, seconds: number, done: (row: Row) => void): Promise<void> {
  const parts: [string, Object3D[]][] = [
    ['background', backdrop?.objects ?? []],
    ['body', [...(body?.objects ?? []), ...(skinned?.objects ?? [])]],
    ['head', head?.objects ?? []],
  ];
  const all = parts.flatMap(([, objects]) => objects);
  const named = parts.filter(([, objects]) => objects.length > 0);
  const rows: typeof parts = named.length > 1 ? [...named, ['all', all]] : named;
  for (const size of [[SQUARE, SQUARE], null] as const) {
    stage.drawAt(size);
    for (const [part, objects] of rows) {
      const timing = await timePictures(stage, all, objects, seconds);
      const [width, height] = stage.figures.pixels;
      done({ part, width, height, ...timing });
    }
  }
}

/**
 * Measures, shows the table as it grows, and prints it to the console; then the visit goes on.
 *
 * @param seconds that each row may take
 */
export async function bench(presence: Presence, seconds = SECONDS): Promise<void> {
  const { stage } = presence;
  const text = document.createElement('pre');
  text.className = 'bench';
  text.setAttribute('role', 'status');
  document.body.append(text);
  const lines = [`${stage.painter.name}, ${navigator.hardwareConcurrency} cores, ${new Date().toISOString().slice(0, 10)}`, '', ...HEADER];
  const show = () => (text.textContent = lines.join('\n'));
  show();
  await measure(presence, seconds, (row) => {
    lines.push(lineOf(row));
    show();
  });
  lines.push('', 'Done.');
  show();
  console.log(text.textContent);
  stage.start();
}

const HEADER = [
  '| drawn      |      pixels | Gaussians | pictures/s |  picture | evaluation |     sort |',
  '|------------|-------------|-----------|------------|----------|------------|----------|',
];

function lineOf({ part, width, height, gaussians, picture, evaluation, sort }: Row): string {
  const cells = [
    part.padEnd(10),
    `${width} × ${height}`.padStart(11),
    String(gaussians).padStart(9),
    (1000 / picture).toFixed(1).padStart(10),
    `${picture.toFixed(1)} ms`.padStart(8),
    `${evaluation.toFixed(2)} ms`.padStart(10),
    `${sort.toFixed(1)} ms`.padStart(8),
  ];
  return `| ${cells.join(' | ')} |`;
}
