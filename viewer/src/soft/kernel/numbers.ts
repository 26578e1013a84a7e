/** The numbers of the rendering convention (`src/ico3d/splat/convention.py`), and the layout of memory. */

export const ONE: f32 = 1;
export const HALF: f32 = 0.5;
export const TWO: f32 = 2;
export const BLUR: f32 = 0.3; // low-pass added to both diagonal entries of the 2D covariance, pixels²
export const NEAR: f32 = 0.01; // m: what is nearer is not drawn
export const FRUSTUM_MARGIN: f32 = 0.3; // half picture sizes outside of the picture at which the Jacobian is held
export const MIN_ALPHA: f32 = 1.0 / 255.0;
export const MAX_ALPHA: f32 = 0.999;
export const MIN_TRANSMITTANCE: f32 = 1e-4;
export const LOG2_E: f32 = 1.4426950408889634;
export const LEVELS_LOG2: f32 = 7.994353436858858; // log2(255)

/** A tile is one vector wide, so that rows of a splat in it are exact; tall ones save entries. */
export const TILE_WIDTH = 4;
export const TILE_HEIGHT = 64;

/** A splat as tiles read it: f32 each, see `project.ts`. */
export const RECORD: usize = 48; // bytes

/** A row of a tile's state: transmittance, red, green, blue of its pixels, one vector each. */
export const ROW: usize = 64; // bytes
