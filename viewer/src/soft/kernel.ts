import encoded from './kernel/index.ts?wasm-bytes';

/** The rasteriser in WebAssembly (`kernel/index.ts`, which says what each function does); addresses are in bytes. */
export interface Kernel {
  readonly memory: WebAssembly.Memory;
  reserve(bytes: number): number;
  layOut(gaussians: number, pairs: number, tiles: number): void;
  begin(fx: number, fy: number, cx: number, cy: number, width: number, height: number, first: number, end: number): void;
  fade(first: number, share: number, wide: number): void;
  addStill(view: number, rows: number, count: number): void;
  addHead(view: number, rows: number, count: number, values: number, rank: number, moves: number): void;
  addWindow(view: number, rows: number, count: number, values: number, positions: number, rotations: number, scales: number, row: number): void;
  addSkinned(view: number, rows: number, count: number, values: number, shapes: number, joints: number, side: number): void;
  bin(all: number): number;
  spread(colours: number, columns: number, step: number, behind: number, stride: number): void;
  draw(behind: number, pixels: number, stride: number, keep: number): number;
  firstChangedColumn(): number;
  endChangedColumn(): number;
  firstChangedRow(): number;
  endChangedRow(): number;
  take(pixels: number, columns: number, height: number, firstColumn: number, endColumn: number, firstRow: number, endRow: number, amount: number, out: number): void;
  seen(): number;
}

/** A new kernel, with memory of its own. */
export async function makeKernel(): Promise<Kernel> {
  const bytes = Uint8Array.from(atob(encoded), (letter) => letter.charCodeAt(0));
  const { instance } = await WebAssembly.instantiate(bytes, { env: { abort: () => {} } });
  return instance.exports as unknown as Kernel;
}
