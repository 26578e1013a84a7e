import { GrowingGenerator } from '../../gaussians/growing.ts';
import type { BakedSkinned, SkinnedRows } from './baked.ts';
import type { Vector } from '../../rig/quaternions.ts';
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
  private readonly outline: { points: Vector[]; carriers: number[] };
  readonly soft: SoftSkinned;

  constructor(baked: BakedSkinned) {
    const { info, lamp } = baked;
    super(info.num_gaussians, baked.count);
    this.baked = baked;
    this.parts = [baked];
    this.most = info.num_gaussians;
    this.skeleton = new Skeleton(info, baked.poses);
    this.table = new Float32Array(TABLE_ROW * info.names.length);
    const soles = solesOf(baked);
    this.outline = {
      points: [...this.skeleton.rig.joints, ...soles.points],
      carriers: [...this.skeleton.rig.joints.keys(), ...soles.carriers],
    };
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

  /** Positions (P,3) of joints and soles in the pose that is shown, m. */
  places(): Float32Array {
    return placesOf(this.outline.points, this.outline.carriers, this.table);
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

const SOLE = 0.03; // m over the lowest of a body at rest
const ENOUGH = 200; // Gaussians that tell where soles are

/** The lowest Gaussians of a body at rest, and the joint that carries each most. */
function solesOf({ means, joints, weights, count }: SkinnedRows): { points: Vector[]; carriers: number[] } {
  const heights = Array.from({ length: count }, (_, i) => means[3 * i + 1]!);
  const floor = heights.reduce((lowest, height) => Math.min(lowest, height), Infinity);
  const low = [...heights.keys()].filter((i) => heights[i]! < floor + SOLE);
  const some = low.filter((_, k) => k % Math.ceil(low.length / ENOUGH) === 0);
  const carrier = (i: number) => {
    const share = weights.subarray(4 * i, 4 * i + 4);
    return joints[4 * i + share.indexOf(Math.max(...share))]!;
  };
  return { points: some.map((i) => [means[3 * i]!, means[3 * i + 1]!, means[3 * i + 2]!]), carriers: some.map(carrier) };
}
