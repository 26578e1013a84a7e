import type { PerspectiveCamera, Scene, Vector3 } from 'three';

/** Draws what is on stage: Spark by the GPU (`stage/spark.ts`), or the processor alone (`painter.ts`). */
export interface Painter {
  readonly pixels: [width: number, height: number]; // of the picture
  readonly gaussians: number; // drawn last
  readonly sorting: boolean;
  readonly lastSortTime: number; // when the last sort began, ms of the performance clock
  readonly sortTook: number; // ms
  /** Whether a picture is being drawn, beside which no other one can be. */
  readonly busy: boolean;
  /** Whether what it draws with was taken away. */
  readonly lost: boolean;
  /** Whether somebody sees the pictures elsewhere than on the canvas. */
  readonly presenting: boolean;
  /** Calls a function before each refresh of the screen, with the time in ms; or none any more. */
  loop(frame: ((now: number) => void) | null): void;
  /** Makes pictures of so many pixels on the page, times a ratio. */
  fit(width: number, height: number, ratio: number): void;
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

/** Makes a painter on a canvas. */
export type MakePainter = (canvas: HTMLCanvasElement, background: readonly [number, number, number], backcloth: Backcloth | null, ports: PainterPorts) => Painter;
