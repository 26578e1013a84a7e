import type { Kernel } from './kernel.ts';
import type { Late, Source } from './source.ts';
import { TILE_HEIGHT, TILE_WIDTH } from './tiles.ts';

/** A source as a picture shows it. */
export interface Placed {
  id: number; // of a source that was put
  view: Float32Array; // (3,4) camera from the source's space: x to the right, y down, z ahead
  drawn: number; // Gaussians
  late?: Late;
  values: Float32Array;
}

/** A picture to draw, or a band of it. */
export interface Frame {
  lens: [fx: number, fy: number, cx: number, cy: number]; // pixels
  width: number;
  height: number;
  band: [first: number, end: number]; // columns of tiles
  placed: Placed[];
}

/** A part of a picture. */
export interface Part {
  columns: [first: number, end: number]; // of tiles
  rows: [first: number, end: number]; // of pixels
}

/** What is behind everybody: colours at every so many pixels, between which they go straight; nothing where there are none. */
export interface Cloth {
  step: number; // pixels, a multiple of a tile's width
  columns: number;
  colours: Float32Array | null; // (rows, columns, 3) display values
}

/** What the steps of a picture took, ms. */
export interface Steps {
  project: number; // evaluates Gaussians and projects them
  spread: number; // background, where it changed
  bin: number;
  blend: number;
}

const MORE = 1.5; // times the room before, where a source takes more than another one in its place
const PAIRS = 1 << 18;
const MOST_PAIRS = 1 << 23; // 0.1 GB; what lies behind so many is left out, which takes tens of thousands of Gaussians that cover the band

/** A source whose rows are in the kernel's memory: as bytes of the page they would be there twice. */
interface Held extends Omit<Source, 'rows'> {
  at: number;
  room: number; // bytes
}

/** Draws pictures of sources, in the kernel's memory. */
export class Rasteriser {
  private readonly kernel: Kernel;
  private readonly held = new Map<number, Held>();
  private readonly view: Room;
  private readonly values: Room;
  private readonly colours: Room;
  private readonly behind: Room;
  private readonly pixels: Room;
  private readonly taken: Room;
  /** Tiles that were drawn last: the others had their pixels already. */
  drawnTiles = 0;
  /** What the band drawn last took. */
  steps: Steps = { project: 0, spread: 0, bin: 0, blend: 0 };
  private shown: { shape: string; cloth: Cloth } | null = null; // in `pixels` and `behind`
  private readonly room: { gaussians: number; pairs: number; tiles: number };

  /** @param pairs of splat and tile, for which there is room at first */
  constructor(kernel: Kernel, pairs = PAIRS) {
    this.kernel = kernel;
    this.room = { gaussians: 0, pairs, tiles: 0 };
    [this.view, this.values, this.colours] = [new Room(kernel), new Room(kernel), new Room(kernel)];
    [this.behind, this.pixels, this.taken] = [new Room(kernel), new Room(kernel), new Room(kernel)];
  }

  /** Takes a source, in place of another one of that number. */
  put(id: number, { rows, ...source }: Source): void {
    let { at, room } = this.held.get(id) ?? { at: 0, room: 0 };
    if (rows.byteLength > room) {
      room = Math.max(rows.byteLength, room && MORE * room);
      at = this.kernel.reserve(room);
    }
    new Uint8Array(this.kernel.memory.buffer, at, rows.byteLength).set(new Uint8Array(rows));
    this.held.set(id, { ...source, at, room });
  }

  /**
   * Draws a band.
   *
   * @param cloth the same one for the same background
   * @returns RGBA of the band, as wide as its tiles; valid until the next call
   */
  draw(frame: Frame, cloth: Cloth): Uint8Array<ArrayBuffer> {
    const { kernel } = this;
    const [first, end] = frame.band;
    const stride = 4 * TILE_WIDTH * (end - first);
    this.layOut(frame);
    const shape = [frame.width, frame.height, first, end].join();
    const before = this.shown?.shape === shape ? this.shown.cloth : null;
    const keep = before !== null && !before.colours === !cloth.colours;
    const pixels = this.pixels.at(stride * frame.height);
    const begin = performance.now();
    this.project(frame);
    const projected = performance.now();
    const behind = this.behind.at(stride * frame.height);
    if (cloth !== before) this.spread(cloth, behind, stride, frame.height);
    const spread = performance.now();
    while (!kernel.bin(Number(this.room.pairs < MOST_PAIRS))) {
      this.room.pairs *= 2;
      this.layOut(frame);
      this.project(frame);
    }
    const binned = performance.now();
    this.drawnTiles = kernel.draw(behind, pixels, stride, Number(keep));
    this.steps = { project: projected - begin, spread: spread - projected, bin: binned - spread, blend: performance.now() - binned };
    this.shown = { shape, cloth };
    return new Uint8Array(kernel.memory.buffer as ArrayBuffer, pixels, stride * frame.height);
  }

  /** The next picture is drawn whole. */
  forget(): void {
    this.shown = null;
  }

  /** What the last picture drew anew; null for nothing. */
  changed({ height }: Frame): Part | null {
    const { kernel } = this;
    if (this.drawnTiles === 0) return null;
    return {
      columns: [kernel.firstChangedColumn(), kernel.endChangedColumn()],
      rows: [TILE_HEIGHT * kernel.firstChangedRow(), Math.min(height, TILE_HEIGHT * kernel.endChangedRow())],
    };
  }

  /**
   * Takes a part of the band that was drawn last.
   *
   * @param amount by which it is sharpened, 64ths, 0 to 31
   * @returns RGBA; valid until the next call
   */
  take({ height, band: [first, end] }: Frame, { columns: [left, right], rows: [top, bottom] }: Part, amount: number): Uint8Array<ArrayBuffer> {
    const { kernel } = this;
    const bytes = 4 * TILE_WIDTH * (right - left) * (bottom - top);
    const out = this.taken.at(bytes);
    kernel.take(this.pixels.at(4 * TILE_WIDTH * (end - first) * height), end - first, height, left - first, right - first, top, bottom, amount, out);
    return new Uint8Array(kernel.memory.buffer as ArrayBuffer, out, bytes);
  }

  /** Writes the pixels of the background. */
  private spread({ colours, columns, step }: Cloth, behind: number, stride: number, height: number): void {
    const { kernel } = this;
    if (colours) kernel.spread(this.colours.write(colours), columns, step, behind, stride);
    else new Uint8Array(kernel.memory.buffer, behind, stride * height).fill(0);
  }

  private project({ lens, width, height, band, placed }: Frame): void {
    this.kernel.begin(...lens, width, height, ...band);
    for (const one of placed) this.add(one);
  }

  private add({ id, view, drawn, values, late }: Placed): void {
    const { kernel } = this;
    const held = this.held.get(id)!;
    const [at, from, given, count] = [held.at, this.view.write(view), this.values.write(values), Math.min(drawn, held.count)];
    const [a, b, c, d] = held.sizes;
    kernel.fade(late?.first ?? count, late?.share ?? 1, late?.wide ?? 1);
    if (held.kind === 'still') kernel.addStill(from, at, count);
    else if (held.kind === 'head') kernel.addHead(from, at, count, given, a!, b!);
    else if (held.kind === 'window') kernel.addWindow(from, at, count, given, a!, b!, c!, d!);
    else kernel.addSkinned(from, at, count, given, a!, b!, c!);
  }

  /** Makes room for what a picture needs at most. */
  private layOut({ height, band: [first, end], placed }: Frame): void {
    const gaussians = placed.reduce((sum, { drawn }) => sum + drawn, 0);
    const tiles = (end - first) * Math.ceil(height / TILE_HEIGHT);
    const { room } = this;
    if (gaussians > room.gaussians) room.gaussians = sizeFor(gaussians);
    if (tiles > room.tiles) room.tiles = sizeFor(tiles);
    this.kernel.layOut(room.gaussians, room.pairs, room.tiles);
  }
}

/** How much room is made where so much is needed, so that what grows little by little takes new room seldom. */
function sizeFor(needed: number): number {
  return 2 ** Math.ceil(Math.log2(needed));
}

/** A place in the kernel's memory that grows, and never gives back. */
class Room {
  private readonly kernel: Kernel;
  private place = 0;
  private size = 0;

  constructor(kernel: Kernel) {
    this.kernel = kernel;
  }

  /** The address of so many bytes. */
  at(bytes: number): number {
    if (bytes > this.size) {
      this.size = sizeFor(bytes);
      this.place = this.kernel.reserve(this.size);
    }
    return this.place;
  }

  /** The address at which the numbers now are. */
  write(numbers: Float32Array | Uint32Array): number {
    const at = this.at(numbers.byteLength);
    new Uint8Array(this.kernel.memory.buffer, at, numbers.byteLength).set(new Uint8Array(numbers.buffer, numbers.byteOffset, numbers.byteLength));
    return at;
  }
}
