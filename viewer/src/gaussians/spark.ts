import { dyno, SplatGenerator, SplatTransformer } from '@sparkjsdev/spark';
import type { Generator } from './generator.ts';

/** What makes the Gaussians of a Spark object on the GPU. */
type GsplatGenerator = NonNullable<SplatGenerator['generator']>;

/** A shader that writes one Gaussian. */
export interface SplatShader {
  declarations: string; // GLSL of its uniforms
  uniforms: Record<string, { value: unknown }>;
  /** GLSL that fills `gsplat`, a variable's name, for the Gaussian of number `index`, another one's. */
  statements(index: string, gsplat: string): string[];
}

/**
 * What Spark draws of a generator: it lies in the generator, and a shader makes its Gaussians whenever
 * they change. Their number never changes, or Spark would hold the old picture until it has sorted anew.
 */
export class SparkTwin extends SplatGenerator {
  private readonly of: Generator;

  /** @param follow takes over what changed of the generator */
  constructor(of: Generator, shader: SplatShader, follow: () => void) {
    const transformer = new SplatTransformer();
    let shown = -1; // version
    super({
      numSplats: of.numSplats,
      generator: splatGenerator(shader, transformer),
      update: () => {
        of.updateMatrixWorld();
        // Without this update, Spark's transformer would place the Gaussians at infinity.
        const moved = transformer.update(this);
        const changed = of.version !== shown;
        shown = of.version;
        if (changed) follow();
        if (moved || changed) this.updateVersion();
      },
    });
    this.of = of;
  }

  /** Whether it takes part in sorting only, and is not to be drawn. */
  get unseen(): boolean {
    return this.of.unseen;
  }
}

/** A generator that runs a shader for each Gaussian and then places it with its object. */
function splatGenerator(shader: SplatShader, transformer: SplatTransformer): GsplatGenerator {
  return dyno.dynoBlock({ index: 'int' }, { gsplat: dyno.Gsplat }, ({ index }) => {
    const node = new dyno.Dyno({
      inTypes: { index: 'int' },
      outTypes: { gsplat: dyno.Gsplat },
      inputs: { index },
      generate: ({ inputs, outputs }) => ({
        globals: [dyno.defineGsplat, shader.declarations],
        statements: shader.statements(inputs.index!, outputs.gsplat!),
        uniforms: shader.uniforms,
      }),
    });
    return { gsplat: transformer.applyGsplat(node.outputs.gsplat) };
  });
}
