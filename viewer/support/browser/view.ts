import { Matrix4, PerspectiveCamera, Vector3 } from 'three';
import type { StartCamera } from '../../src/bundle/manifest.ts';
import type { Cloth, Frame } from '../../src/soft/rasteriser.ts';
import { TILE_WIDTH } from '../../src/soft/tiles.ts';

const CLOTH_STEP = 8; // pixels

/** The camera of a manifest as the rasteriser takes it. */
export function viewOf({ eye, target, up, fov_y }: StartCamera, width: number, height: number): { view: Float32Array; lens: Frame['lens'] } {
  const camera = new PerspectiveCamera(fov_y);
  camera.position.set(...eye);
  camera.up.set(...up);
  camera.lookAt(new Vector3(...target));
  camera.updateMatrixWorld();
  const rows = new Matrix4().makeScale(1, -1, -1).multiply(camera.matrixWorldInverse).transpose();
  const focal = height / 2 / Math.tan((fov_y * Math.PI) / 360);
  return { view: Float32Array.from(rows.elements.slice(0, 12)), lens: [focal, focal, width / 2, height / 2] };
}

/**
 * A background as the rasteriser takes it.
 *
 * @param colour display values, the same everywhere or by the place in pixels
 */
export function clothOf(colour: readonly number[] | ((x: number, y: number) => readonly number[]), width: number, height: number): Cloth {
  const columns = Math.ceil((width + TILE_WIDTH) / CLOTH_STEP) + 2;
  const rows = Math.ceil(height / CLOTH_STEP) + 2;
  const colours = new Float32Array(3 * columns * rows);
  for (let i = 0; i < columns * rows; i++) {
    colours.set(typeof colour === 'function' ? colour(CLOTH_STEP * (i % columns), CLOTH_STEP * Math.floor(i / columns)) : colour, 3 * i);
  }
  return { step: CLOTH_STEP, columns, colours };
}
