/** What draws by WebGL, with Spark: fetched where WebGL draws only. */
import { WindowGenerator } from '../body/generator.ts';
import { SkinnedGenerator } from '../body/skinned/generator.ts';
import { SparkSkinned } from '../body/skinned/spark.ts';
import { SparkWindow } from '../body/spark.ts';
import type { Generator } from '../gaussians/generator.ts';
import { HeadGenerator } from '../head/generator.ts';
import { SparkHead } from '../head/spark.ts';
import type { MakePainter } from '../soft/contract.ts';
import { makeTwin as makeBackdropTwin } from '../stage/backdrop/spark.ts';
import { StillGenerator } from '../stage/backdrop/still.ts';
import { SparkPainter, type Twin } from '../stage/webgl/spark.ts';

export const makeSparkPainter: MakePainter = (easel, ports) => new SparkPainter(easel, ports, makeTwin);

function makeTwin(generator: Generator): Twin {
  if (generator instanceof HeadGenerator) return new SparkHead(generator);
  if (generator instanceof SkinnedGenerator) return new SparkSkinned(generator);
  if (generator instanceof WindowGenerator) return new SparkWindow(generator);
  if (generator instanceof StillGenerator) return makeBackdropTwin(generator);
  throw new Error('Spark cannot draw this generator.');
}
