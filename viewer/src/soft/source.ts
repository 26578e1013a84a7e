/**
 * What has Gaussians to draw, as the kernel reads them.
 *
 * Rows are f32 unless said otherwise, one for each Gaussian: centre (3), rotation wxyz (4), scales in
 * metres (3), and from byte 40 on
 *
 * - `still`: colour (3), opacity.
 * - `head`: scale of the basis, mean logits (4), share of the shoulders' motion; from byte 64 the K basis vectors, 4 i8
 *   each, and the M displacements, 3 i8 and nothing each.
 * - `window`: colour (3), opacity, cluster (u32); from byte 64 the P + R + L basis vectors, 4 i16 each.
 * - `skinned`: colour logits (3), opacity, nothing, normal (3), metres and logits per unit of the
 *   shapes, joints (4 u8), weights (4 u8); from byte 96 the K shapes, 8 i8 each: position, 0, logits, 0.
 */
export interface Source {
  kind: Kind;
  count: number; // Gaussians
  rows: ArrayBuffer;
  /**
   * - `head`: K, M.
   * - `window`: P, R, L, numbers in a cluster's row of values.
   * - `skinned`: K, joints, texels along a side of the shadow map or 0.
   */
  sizes: number[];
}

export type Kind = 'still' | 'head' | 'window' | 'skinned';

/** Bytes of a row before basis vectors or shapes. */
export const ROW_BYTES: Record<Kind, number> = { still: 64, head: 64, window: 64, skinned: 96 };

/** Gaussians of a head or a skinned body that appear: those from a number on have a share of their opacity, those before are wider. */
export interface Late {
  first: number;
  share: number;
  wide: number;
}

/** Something on stage that has Gaussians; it moves as its object does. */
export interface SoftObject {
  /** The source; another one when other Gaussians are to be drawn. */
  readonly source: Source | null;
  /** Number of its first Gaussians that are drawn now. */
  readonly drawn: number;
  /** Those of them that came later, where there may be such ones. */
  readonly late?: Late;
  /**
   * What changes from picture to picture.
   *
   * - `head`: K coefficients; M steps, metres; motion of the shoulders, rotation wxyz and shift (7).
   * - `window`: a row for each cluster.
   * - `skinned`: light (8,4), lamp (5,4), K ≤ 8 coefficients of the shapes in 8 places, table of joints
   *   (J,16), shadow map.
   */
  readonly values: Float32Array;
}

/** New rows, as bytes and as numbers. */
export function makeRows(count: number, stride: number): { rows: ArrayBuffer; floats: Float32Array; bytes: DataView } {
  const rows = new ArrayBuffer(count * stride);
  return { rows, floats: new Float32Array(rows), bytes: new DataView(rows) };
}
