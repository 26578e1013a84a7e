import { GrowingGenerator } from '../../gaussians/growing.ts';
import type { BakedSkinned, SkinnedRows } from './baked.ts';
import { ShadowMap } from './shadow.ts';
import { placesOf, Skeleton, TABLE_ROW, type Pose } from './skeleton.ts';
import { SoftSkinned } from './soft.ts';

/** A body on a skeleton as a generator: its Gaussians move, turn and are coloured with their joints. */
export class SkinnedGenerator extends GrowingGenerator {
  readonly baked: BakedSkinned;
  readonly skeleton: Skeleton;
  /** The first Gaussians, and those that came later. */
  readonly parts: SkinnedRows[];
  /** Joints in the pose shown, (J, TABLE_ROW). */
  readonly table: Float32Array;
  /** Coefficients of the residual shapes in the pose shown, (K,). */
  residual: Float64Array = new Float64Array(0);
  /** What the lamp sees, where there is one. */
  readonly map: ShadowMap | null;
  /** Gaussians that are drawn at most. */
  most: number;
  readonly soft: SoftSkinned;

  constructor(baked: BakedSkinned) {
    const { info, lamp } = baked;
    super(info.num_gaussians, baked.count);
    this.baked = baked;
    this.parts = [baked];
    this.most = info.num_gaussians;
    this.skeleton = new Skeleton(info, baked.poses);
    this.table = new Float32Array(TABLE_ROW * info.names.length);
    this.map = lamp && new ShadowMap(lamp, info.names.length);
    this.soft = new SoftSkinned(this);
  }

  /** Shows a pose. */
  pose(pose: Pose): void {
    this.skeleton.table(pose, this.table);
    this.residual = pose.residual;
    this.map?.draw(this.table);
    this.changed();
  }

  /** Positions (J,3) of the joints in the pose that is shown, m. */
  places(): Float32Array {
    return placesOf(this.skeleton.rig.joints, this.table);
  }

  /** Takes the Gaussians that come after the first ones; they are not seen until `grow`. */
  complete(rest: SkinnedRows): void {
    this.parts.push(rest);
    this.changed();
  }

  /** Limits the number of Gaussians that are drawn, to the most important ones. */
  limit(count: number): void {
    this.most = Math.min(count, this.numSplats);
    this.changed();
  }
}
