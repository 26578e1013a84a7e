import type { PerspectiveCamera, Scene, Vector3 } from 'three';

/** What may draw: Spark by WebGL, or the processor alone. */
export type Path = 'webgl' | 'soft';

/** Draws what is on stage: Spark by the GPU (`stage/webgl/spark.ts`), or the processor alone (`painter.ts`). */
export interface Painter {
  readonly path: Path;
  readonly name: string; // of what draws, as tables of measurements call it
  readonly pixels: [width: number, height: number]; // of the picture
  readonly gaussians: number; // drawn last
  readonly sorting: boolean;
  readonly lastSortTime: number; // when the last sort began, ms of the performance clock
  readonly sortTook: number; // ms
  /** How long it was until the last picture was there, ms, where others than this thread draw; null where painting takes that long. */
  readonly drawTook: number | null;
  /** Whether a picture is being drawn, beside which no other one can be. */
  readonly busy: boolean;
  /** Whether what it draws with was taken away. */
  readonly lost: boolean;
  /** Whether a picture at rest is drawn as fine as can be at once, whatever moving ones are. */
  readonly refines: boolean;
  /** Whether somebody sees the pictures elsewhere than on the canvas. */
  readonly presenting: boolean;
  /** Calls a function before each refresh of the screen, with the time in ms; or none any more. */
  loop(frame: ((now: number) => void) | null): void;
  /**
   * Makes pictures for so many pixels on the page.
   *
   * @param ratio pixels of the screen for one of the page, along a side
   * @param share of these that are drawn, along a side; the picture is enlarged to them
   */
  fit(width: number, height: number, ratio: number, share: number): void;
  /** @param immersed the picture is seen in a headset */
  paint(scene: Scene, camera: PerspectiveCamera, immersed: boolean): void;
  /** Resolves when nothing is missing for a picture as it should be. */
  settle(scene: Scene, camera: PerspectiveCamera): Promise<void>;
  /** Resolves when the picture painted last is seen. */
  shown(): Promise<void>;
  dispose(): void;
}

/** What a painter says to the stage. */
export interface PainterPorts {
  /** Another picture is due though nobody moved. */
  dirty(): void;
  /** It cannot draw any more for a while. */
  lost(): void;
  /** It can draw again. */
  restored(): void;
  /** It will never draw again. */
  gone(): void;
}

/** What is behind everybody, by where one looks; colours are display values. */
export interface Backcloth {
  /** Whether it is there at all. */
  readonly shows: boolean;
  /** Changes with its look. */
  readonly version: number;
  /** Writes the colour (3,) that an eye sees in a direction of length 1. */
  colour(eye: Vector3, way: Vector3, out: Float32Array, at: number): void;
}

/** What a painter paints on, and what. */
export interface Easel {
  canvas: HTMLCanvasElement;
  scene: Scene;
  background: readonly [number, number, number]; // display values
  backcloth: Backcloth;
  /** What is behind the canvas is seen around the avatar. */
  transparent: boolean;
}

/** Makes a painter. */
export type MakePainter = (easel: Easel, ports: PainterPorts) => Painter;
