import type { Object3D } from 'three';

/** What moves on stage: a head, a body. */
export interface Actor {
  readonly objects: Object3D[]; // always the same ones
  /** Points (N,3) of a body in the world, m, among them those of its feet; the same array while it has not moved. */
  readonly points?: Float32Array | null;
  /** Goes on by `step` seconds, many after the page was hidden; returns false if it looks as before. */
  tick(step: number): boolean;
  /** Draws a share of what stands behind people, what covers most of it first. */
  thin?(share: number): void;
  /** Draws a share of a person's Gaussians, the most important ones first. */
  limit?(share: number): void;
  /** A picture is about to be drawn; `now` in ms, performance clock. */
  drawing?(now: number): void;
}
