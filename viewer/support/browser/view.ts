import { Matrix4, PerspectiveCamera, Vector3 } from 'three';
import type { StartCamera } from '../../src/bundle/manifest.ts';
import type { Frame } from '../../src/soft/rasteriser.ts';

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
