import type { Kernel } from './kernel.ts';
import type { Source } from './source.ts';
import { TILE_HEIGHT, TILE_WIDTH } from './tiles.ts';

/** A source as a picture shows it. */
export interface Placed {
  id: number; // of a source that was put
  view: Float32Array; // (3,4) camera from the source's space: x to the right, y down, z ahead
  drawn: number; // Gaussians
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

const PAIRS = 1 << 18;

/** Draws pictures of sources, in the kernel's memory. */
export class Rasteriser {
  private readonly kernel: Kernel;
  private readonly held = new Map<number, { source: Source; at: number; room: number }>();
  private readonly view: Room;
  private readonly values: Room;
  private readonly behind: Room;
  private readonly pixels: Room;
  /** Tiles that were drawn last: the others had their pixels already. */
  drawnTiles = 0;
  private shown: { shape: string; behind: Uint32Array } | null = null; // in `pixels`
  private readonly room: { gaussians: number; pairs: number; tiles: number };

  /** @param pairs of splat and tile, for which there is room at first */
  constructor(kernel: Kernel, pairs = PAIRS) {
    this.kernel = kernel;
    this.room = { gaussians: 0, pairs, tiles: 0 };
    [this.view, this.values, this.behind, this.pixels] = [new Room(kernel), new Room(kernel), new Room(kernel), new Room(kernel)];
  }

  /** Takes a source, in place of another one of that number. */
  put(id: number, source: Source): void {
    const { rows } = source;
    let { at, room } = this.held.get(id) ?? { at: 0, room: 0 };
    if (rows.byteLength > room) [at, room] = [this.kernel.reserve(rows.byteLength), rows.byteLength];
    new Uint8Array(this.kernel.memory.buffer, at, rows.byteLength).set(new Uint8Array(rows));
    this.held.set(id, { source, at, room });
  }

  /**
   * Draws a band.
   *
   * @param behind RGBA of the band's background; the same array for the same colours
   * @returns RGBA of the band, as wide as its tiles; valid until the next call
   */
  draw(frame: Frame, behind: Uint32Array): Uint8Array<ArrayBuffer> {
    const { kernel } = this;
    const [first, end] = frame.band;
    const stride = 4 * TILE_WIDTH * (end - first);
    this.layOut(frame);
    const shape = [frame.width, frame.height, first, end].join();
    const keep = this.shown?.shape === shape && this.shown.behind === behind;
    const under = keep ? this.behind.at(behind.byteLength) : this.behind.write(behind);
    const pixels = this.pixels.at(stride * frame.height);
    this.project(frame);
    while (!kernel.bin()) {
      this.room.pairs *= 2;
      this.room.gaussians = 0;
      this.layOut(frame);
      this.project(frame);
    }
    this.drawnTiles = kernel.draw(under, pixels, stride, Number(keep));
    this.shown = { shape, behind };
    return new Uint8Array(kernel.memory.buffer as ArrayBuffer, pixels, stride * frame.height);
  }

  private project({ lens, width, height, band, placed }: Frame): void {
    this.kernel.begin(...lens, width, height, ...band);
    for (const one of placed) this.add(one);
  }

  private add({ id, view, drawn, values }: Placed): void {
    const { kernel } = this;
    const { source, at } = this.held.get(id)!;
    const [from, given, count] = [this.view.write(view), this.values.write(values), Math.min(drawn, source.count)];
    const [a, b, c, d] = source.sizes;
    if (source.kind === 'still') kernel.addStill(from, at, count);
    else if (source.kind === 'head') kernel.addHead(from, at, count, given, a!);
    else if (source.kind === 'window') kernel.addWindow(from, at, count, given, a!, b!, c!, d!);
    else kernel.addSkinned(from, at, count, given, a!, b!, c!);
  }

  /** Makes room for what a picture needs at most. */
  private layOut({ height, band: [first, end], placed }: Frame): void {
    const gaussians = placed.reduce((sum, { drawn }) => sum + drawn, 0);
    const tiles = (end - first) * Math.ceil(height / TILE_HEIGHT);
    const { room } = this;
    if (gaussians <= room.gaussians && tiles <= room.tiles) return;
    room.gaussians = Math.max(gaussians, room.gaussians);
    room.tiles = Math.max(tiles, room.tiles);
    this.kernel.layOut(room.gaussians, room.pairs, room.tiles);
  }
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
      this.size = 2 ** Math.ceil(Math.log2(bytes));
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
